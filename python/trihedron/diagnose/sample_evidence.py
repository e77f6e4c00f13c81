"""Effects with evidence in the samples: what their own tests find joins the hypothesis, each held to its promise."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.direct import MIN_FALL, MUST_HALVE, DirectEffect, Evidence
from trihedron.diagnose.residuals.goodness_of_fit import ROW_DOMAINS
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Fit, Prediction, folds_of, predict_held_out, tune_noise
from trihedron.diagnose.session.state import DYNAMICS, MOVES, NO_DISTORTION, Prior, SessionState
from trihedron.records.diagnosis import Candidate

VISIBLE = 0.98
"""Readings that were changed must lower the held-out misfit of some domain by at least this factor."""


@dataclass(frozen=True, eq=False)
class Seen:
    """One effect that its own test finds in the samples; ``gain`` in twice a log-likelihood."""

    effect: DirectEffect
    evidence: Evidence
    gain: float

    @property
    def reobserves(self) -> bool:
        """Whether it changes what the observations claim (samples put back, moves left out, noise of a coarse code)."""
        return self.evidence.reweigh is not None


@dataclass(frozen=True, eq=False)
class Observed:
    """Observations as what was seen in the samples changes them, fitted in predicted noise; ``refused`` are ids of
    effects whose mending did not predict held-out moves any better."""

    bare: Observations
    fitted: Fit
    seen: tuple[Seen, ...] = ()
    refused: frozenset[str] = frozenset()

    @property
    def obs(self) -> Observations:
        """The observations as they now are."""
        return self.fitted.line.obs


def look(
    observed: Observed,
    context: Context,
    alpha: float,
    start: SessionState,
    prior: Prior | None,
    only: Collection[str] = (),
) -> tuple[Observed, dict[str, Candidate]]:
    """Observations with every effect whose own test finds it in a context, and what every such test said."""
    held = {one.effect.id for one in observed.seen if not one.effect.repeatable} | observed.refused
    candidates: dict[str, Candidate] = {}
    found: list[tuple[DirectEffect, Evidence]] = []
    for effect in catalogue():
        if not isinstance(effect, DirectEffect) or effect.id in held or (only and effect.id not in only):
            continue
        reason = effect.unavailable(context)
        if reason is not None:
            candidates[effect.id] = Candidate(effect.id, None, False, reason)
            continue
        evidence = effect.find(context)
        if not effect.repeatable or evidence is not None:
            candidates[effect.id] = Candidate(effect.id, 1.0 if evidence is None else evidence.p_value, True)
        # Half of the rate of false alarms is theirs, half the search's.
        if evidence is not None and evidence.p_value * len(catalogue()) < alpha / 2.0:
            found.append((effect, evidence))
    for effect, evidence in sorted(found, key=lambda pair: -pair[1].strength):
        observed = _with_one(observed, effect, evidence, start, prior)
    return observed, candidates


def _with_one(
    observed: Observed, effect: DirectEffect, evidence: Evidence, start: SessionState, prior: Prior | None
) -> Observed:
    gain, fitted = float(evidence.strength), observed.fitted
    if evidence.reweigh is not None:
        found = [*(one.evidence for one in observed.seen), evidence]
        obs = evidence.reweigh(observed.obs) if evidence.touched is None else _changed(observed.bare, found)
        begin = fitted.state if obs.n_poses == observed.obs.n_poses else start
        fitted = tune_noise(obs, replace(begin, effect=np.zeros(0)), NO_DISTORTION, prior)
        if not effect.is_proof and not _mends(observed.fitted, fitted, evidence.touched):
            return replace(observed, refused=observed.refused | {effect.id})
        gain = _explained(observed.fitted, fitted)
        if evidence.restate is not None:
            evidence = replace(evidence, parameters=evidence.restate(Context(obs, fitted)))
    return replace(observed, fitted=fitted, seen=(*observed.seen, Seen(effect, evidence, gain)))


def _explained(before: Fit, after: Fit) -> float:
    """Twice the log-likelihood gained by readings that were changed, every domain's noise being of free strength."""
    gain = 0.0
    for domain in ROW_DOMAINS:
        (was, n), (now, left) = (_per_row(fitted, domain) for fitted in (before, after))
        # Rows that were left out speak for themselves alone.
        of = n - left if n - left >= 1.0 else n
        gain += of * float(np.log(max(was, 1.0) / max(now, 1.0)))
    return max(gain, 0.0)


def _per_row(fitted: Fit, domain: int) -> tuple[float, float]:
    """Chi-square per degree of freedom of one domain, and those degrees."""
    rows = fitted.system.domain == domain
    dof = float((1.0 - fitted.leverage[rows]).sum())
    return float((fitted.system.residual[rows] ** 2).sum()) / max(dof, 1.0), dof


def _changed(bare: Observations, found: list[Evidence]) -> Observations:
    """The bare observations as what was found changes them; samples are put back first, for that makes them anew."""
    for evidence in sorted(found, key=lambda one: one.touched is None):
        if evidence.reweigh is not None:
            bare = evidence.reweigh(bare)
    return bare


def _mends(before: Fit, after: Fit, touched: tuple[int, ...] | None) -> bool:
    """Whether readings that were changed (samples put back, timestamps made even) are predicted better when held out.

    Where only some moves were ``touched``, gravity and rest after those very moves must say so, in the dispersion that
    the others have: a jolt that looks like a loss leaves them as they were.
    """
    was, now = (predict_held_out(fitted, folds_of(fitted)) for fitted in (before, after))
    stays = np.maximum(now.per_row, 1.0)
    gain = float(((was.per_row - now.per_row) * now.n_rows / stays).sum())
    if gain <= 0.0 or not (now.per_row < VISIBLE * was.per_row).any():
        return False
    if touched is None:
        return True
    (there, others), (there_after, _) = (_of_moves(*pair, touched) for pair in ((before, was), (after, now)))
    usual = max(float(np.mean(others)) if len(others) else 1.0, 1.0)
    fall = float(there.sum() - there_after.sum())
    return fall > MIN_FALL * usual and float(there_after.mean()) < MUST_HALVE * float(there.mean())


def _of_moves(fitted: Fit, prediction: Prediction, moves: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Squared held-out residuals of the rows of some moves, and those of all other moves."""
    system = fitted.system
    rows = np.isin(system.domain, (MOVES, DYNAMICS)) & (system.walk == 0)
    named = np.isin(system.segment, moves)
    squared = prediction.residual**2
    return squared[rows & named], squared[rows & ~named]
