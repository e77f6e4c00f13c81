"""Effects detected by their own tests on the samples: the observations are corrected for each."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import by_id, catalogue
from trihedron.diagnose.effects.contract import DirectEffect, Evidence
from trihedron.diagnose.session.solve import Fit, tune_noise
from trihedron.records.diagnosis import Candidate
from trihedron.session.model import misfits


@dataclass(frozen=True, eq=False)
class Seen:
    """One effect detected by its own test on the samples; ``gain`` in twice a log-likelihood."""

    effect: DirectEffect
    evidence: Evidence
    gain: float

    @property
    def reobserves(self) -> bool:
        """Whether it changes the observations (gaps of time, moves excluded, noise of a coarse resolution)."""
        return self.evidence.reweigh is not None


@dataclass(frozen=True, eq=False)
class Observed:
    """Observations corrected for the effects detected in the samples, fitted in predicted noise.

    ``found`` is the evidence of every test, ``tested`` their results, by id of the effect.
    """

    fitted: Fit
    seen: tuple[Seen, ...]
    found: Mapping[str, Evidence]
    tested: Mapping[str, Candidate]


def look(context: Context, alpha: float) -> Observed:
    """Observations corrected for every effect that its own test detects, and the result of every test."""
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
    fitted, seen = context.fitted, []
    for key, evidence in sorted(found.items(), key=lambda pair: -pair[1].strength):
        effect, gain = by_id()[key], float(evidence.strength)
        # Half of the false-alarm rate is for these tests, half for the search.
        if not isinstance(effect, DirectEffect) or evidence.p_value * len(catalogue()) >= alpha / 2.0:
            continue
        if evidence.reweigh is not None:
            before, fitted = fitted, tune_noise(evidence.reweigh(fitted.obs), fitted.state, fitted.prior)
            gain = _explained(before, fitted)
        seen.append(Seen(effect, evidence, gain))
    return Observed(fitted, tuple(seen), found, tested)


def _explained(before: Fit, after: Fit) -> float:
    """Gain of a correction in twice the log-likelihood, the noise strength of every domain being free."""
    (chi2, n), (chi2_after, left) = misfits(before.core), misfits(after.core)
    was, now = chi2 / np.maximum(n, 1.0), chi2_after / np.maximum(left, 1.0)
    # Excluded rows alone count where a correction removes rows.
    of = np.where(n - left >= 1.0, n - left, n)
    return max(float((of * np.log(np.maximum(was, 1.0) / np.maximum(now, 1.0))).sum()), 0.0)
