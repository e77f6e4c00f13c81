"""Effects detected by their own tests on the samples: each correction is kept only if it improves the prediction."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import by_id, catalogue
from trihedron.diagnose.effects.contract import DirectEffect, Evidence
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Fit, Prediction, predict_held_out, tune_noise
from trihedron.probability import LN_FAULT, chdtri
from trihedron.records.diagnosis import Candidate
from trihedron.session.model import DYNAMICS, MOVES, SessionState, misfits

MUST_HALVE = 0.5
"""Largest share of the misfit of its move that may remain after samples were inserted: a jolt leaves more."""
VISIBLE = 0.98
"""A correction of the readings must lower the held-out misfit of some domain by at least this factor."""


@dataclass(frozen=True, eq=False)
class Seen:
    """One effect detected by its own test on the samples; ``gain`` in twice a log-likelihood."""

    effect: DirectEffect
    evidence: Evidence
    gain: float

    @property
    def reobserves(self) -> bool:
        """Whether it changes the observations (samples inserted, moves excluded, noise of a coarse resolution)."""
        return self.evidence.reweigh is not None


@dataclass(frozen=True, eq=False)
class Observed:
    """Observations corrected for the effects detected in the samples, fitted in predicted noise.

    ``found`` is the evidence of every test, by id of its effect, less that of effects whose correction did not improve
    the prediction of held-out moves.
    """

    bare: Observations
    fitted: Fit
    seen: tuple[Seen, ...] = ()
    found: Mapping[str, Evidence] = field(default_factory=dict)

    @property
    def obs(self) -> Observations:
        return self.fitted.obs


def look(
    observed: Observed, context: Context, alpha: float, start: SessionState
) -> tuple[Observed, dict[str, Candidate]]:
    """Observations corrected for every effect that its own test detects, and the result of every test."""
    candidates: dict[str, Candidate] = {}
    found: dict[str, Evidence] = {}
    for effect in catalogue():
        if not isinstance(effect, DirectEffect):
            continue
        reason = effect.unavailable(context)
        if reason is not None:
            candidates[effect.id] = Candidate(effect.id, None, False, reason)
            continue
        evidence = effect.find(context)
        if not effect.is_local or evidence is not None:
            candidates[effect.id] = Candidate(effect.id, 1.0 if evidence is None else evidence.p_value, True)
        if evidence is not None:
            found[effect.id] = evidence
    observed = replace(observed, found=found)
    for key, evidence in sorted(found.items(), key=lambda pair: -pair[1].strength):
        effect = by_id()[key]
        # Half of the false-alarm rate is for these tests, half for the search.
        if isinstance(effect, DirectEffect) and evidence.p_value * len(catalogue()) < alpha / 2.0:
            observed = _with_one(observed, effect, evidence, start)
    return observed, candidates


def _with_one(observed: Observed, effect: DirectEffect, evidence: Evidence, start: SessionState) -> Observed:
    gain, fitted = float(evidence.strength), observed.fitted
    if evidence.reweigh is not None:
        found = [*(one.evidence for one in observed.seen), evidence]
        obs = evidence.reweigh(observed.obs) if evidence.begins is None else _changed(observed.bare, found)
        begin = fitted.state if obs.n_poses == observed.obs.n_poses else start
        fitted = tune_noise(obs, begin, fitted.prior)
        if not effect.is_proof and not _mends(observed.fitted, fitted, evidence.begins):
            return replace(observed, found={k: one for k, one in observed.found.items() if one is not evidence})
        gain = _explained(observed.fitted, fitted)
    return replace(observed, fitted=fitted, seen=(*observed.seen, Seen(effect, evidence, gain)))


def _explained(before: Fit, after: Fit) -> float:
    """Gain of a correction in twice the log-likelihood, the noise strength of every domain being free."""
    (chi2, n), (chi2_after, left) = misfits(before.core), misfits(after.core)
    was, now = chi2 / np.maximum(n, 1.0), chi2_after / np.maximum(left, 1.0)
    # Excluded rows alone count where a correction removes rows.
    of = np.where(n - left >= 1.0, n - left, n)
    return max(float((of * np.log(np.maximum(was, 1.0) / np.maximum(now, 1.0))).sum()), 0.0)


def _changed(bare: Observations, found: list[Evidence]) -> Observations:
    """The bare observations with all corrections; inserted samples come first, as they rebuild the observations."""
    for evidence in sorted(found, key=lambda one: one.begins is None):
        if evidence.reweigh is not None:
            bare = evidence.reweigh(bare)
    return bare


def _mends(before: Fit, after: Fit, begins: frozenset[int] | None) -> bool:
    """Whether corrected readings (samples inserted, timestamps made even) are predicted better when held out.

    Where only the moves that begin at some poses were changed, the misfit of gravity and velocity after these must
    fall, in units of the dispersion of the other moves: after a jolt that looks like a loss it does not. The others may
    have lost samples too, and decide over the rest of the session.
    """
    was, now = predict_held_out(before), predict_held_out(after)
    if begins is None:
        gain = float(((was.per_row - now.per_row) * now.n_rows / np.maximum(now.per_row, 1.0)).sum())
        return gain > 0.0 and bool((now.per_row < VISIBLE * was.per_row).any())
    (there, others), (there_after, _) = (_of_moves(*pair, begins) for pair in ((before, was), (after, now)))
    # The upper quartile: up to a quarter of the other moves may have lost samples too.
    usual = max(float(np.quantile(others, 0.75) / chdtri(1, 0.25)) if len(others) else 1.0, 1.0)
    fall = float(there.sum() - there_after.sum())
    return fall > 2.0 * LN_FAULT * usual and float(there_after.mean()) < MUST_HALVE * float(there.mean())


def _of_moves(fitted: Fit, prediction: Prediction, begins: Collection[int]) -> tuple[np.ndarray, np.ndarray]:
    """Squared held-out residuals of the rows of the moves that begin at these poses, and those of all other moves."""
    system = fitted.system
    rows = np.isin(system.domain, (MOVES, DYNAMICS)) & (system.walk == 0)
    named = np.isin(system.segment, fitted.obs.moves_from(begins))
    squared = prediction.residual**2
    return squared[rows & named], squared[rows & ~named]
