"""Effects detected by their own tests on the samples: the observations are corrected for each."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.contract import DirectEffect, Evidence
from trihedron.diagnose.hypothesis import Hypothesis, hypothesis
from trihedron.records.diagnosis import Candidate
from trihedron.session.model import misfits


@dataclass(frozen=True, eq=False)
class Observed:
    """The session with observations corrected for the effects detected in the samples.

    By id of the effect: ``found`` is the evidence of every test, ``seen`` that of the effects which are accepted, with
    the gain of the correction as its strength, ``tested`` the results of the tests.
    """

    model: Hypothesis
    seen: Mapping[str, Evidence]
    found: Mapping[str, Evidence]
    tested: Mapping[str, Candidate]


def look(model: Hypothesis, alpha: float) -> Observed:
    """Observations corrected for every effect that its own test detects, and the result of every test."""
    context = model.context
    tested: dict[str, Candidate] = {}
    found: dict[str, Evidence] = {}
    for effect in catalogue():
        if not isinstance(effect, DirectEffect):
            continue
        reason = effect.unavailable(context)
        if reason is not None:
            tested[effect.id] = Candidate(effect.id, None, False, reason)
            continue
        evidence = effect.find(context)
        if not effect.is_local or evidence is not None:
            tested[effect.id] = Candidate(effect.id, 1.0 if evidence is None else evidence.p_value, True)
        if evidence is not None:
            found[effect.id] = evidence
    seen: dict[str, Evidence] = {}
    for key, evidence in sorted(found.items(), key=lambda pair: -pair[1].strength):
        # Half of the false-alarm rate is for these tests, half for the search.
        if evidence.p_value * len(catalogue()) >= alpha / 2.0:
            continue
        seen[key] = evidence
        if evidence.reweigh is not None:
            before, fitted = model, model.fitted
            model = hypothesis(evidence.reweigh(model.obs), fitted.state, fitted.prior, within=model.within)
            seen[key] = replace(evidence, strength=_explained(before, model))
    return Observed(model, seen, found, tested)


def _explained(before: Hypothesis, after: Hypothesis) -> float:
    """Gain of a correction in twice the log-likelihood, the noise strength of every domain being free."""
    (chi2, n), (chi2_after, left) = misfits(before.fitted.core), misfits(after.fitted.core)
    was, now = chi2 / np.maximum(n, 1.0), chi2_after / np.maximum(left, 1.0)
    # Excluded rows alone count where a correction removes rows.
    of = np.where(n - left >= 1.0, n - left, n)
    return max(float((of * np.log(np.maximum(was, 1.0) / np.maximum(now, 1.0))).sum()), 0.0)
