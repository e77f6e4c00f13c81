"""Samples lost without a gap in the timestamps: the two sides join only if samples are inserted (eq. 8.16)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import MOST_NAMED, DirectEffect, Evidence
from trihedron.diagnose.effects.saturation import clipped_samples
from trihedron.diagnose.session.lost_samples import with_gaps, with_inserted
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import fit, move_residuals
from trihedron.probability import CLEAR, LN_FAULT, chdtri
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Where
from trihedron.session.joints import joints, most_lost
from trihedron.session.model import Prior, SessionState

CONTRADICTS, FEWEST_MOVES = 10.0, 3
"""Misfit, in medians of all moves, above which a move contradicts the session: by chance one in thirty million."""
ROWS = 5
"""Rows of a move: gravity after it, velocity over it."""


@dataclass(frozen=True)
class Loss:
    """Samples missing behind ``sample`` of ``move``: their number, the chi-square that they gain, and whether the
    motion alone decides."""

    sample: int
    move: int
    count: int
    gain: float
    is_certain: bool


def find_losses(obs: Observations) -> list[Loss]:
    """Intervals where the motion joins only with samples missing between its two sides (eq. 8.16), in order."""
    moves = np.array(obs.move_ranges, dtype=np.int64).reshape(-1, 2)
    found = joints(list(obs.whitened), obs.time_s, obs.recording.rate_hz, moves, clipped_samples(obs))
    owner = [int(np.flatnonzero((moves[:, 0] <= k) & (k < moves[:, 1]))[0]) for k in found.sample]
    each = zip(found.sample, owner, found.count, found.gain, found.is_certain, strict=True)
    losses = [Loss(int(k), m, int(count), 2.0 * float(gain), bool(sure)) for k, m, count, gain, sure in each]
    return sorted(losses, key=lambda loss: loss.sample)


def counted_losses(context: Context) -> tuple[list[Loss], dict[int, float]]:
    """Losses with their counts, and the standard error of each count by its sample.

    The joint of the two sides of a gap gives the place and an approximate count. Gravity and zero velocity after the
    move determine the exact count, or show that nothing is missing, because a loss changes the integrated rotation. The
    session is fitted with those that the motion alone decides, as gaps of time, and without the moves that seem to have
    other losses, half of all at the most, so that a loss cannot bias it.
    """
    obs, losses = context.obs, find_losses(context.obs)
    if not losses:
        return [], {}
    doubtful = [one for one in sorted(losses, key=lambda one: -one.gain) if not one.is_certain]
    touched = set(list(dict.fromkeys(one.move for one in doubtful))[: obs.n_moves // 2])
    whole = with_gaps(obs, {one.sample: one.count for one in losses if one.is_certain})
    clean = _of_moves_that_agree(whole.without_moves(touched), context.fitted.state, context.fitted.prior)
    misfit = (move_residuals(whole, clean) ** 2).sum(axis=1)
    usual = max(float(np.median([v for m, v in enumerate(misfit) if m not in touched])) / chdtri(ROWS, 0.5), 1.0)
    counted: list[Loss] = []
    sigmas: dict[int, float] = {}
    for m in range(obs.n_moves):
        move = _Move(obs, clean, m, usual)
        own = move.counted([loss for loss in losses if loss.move == m])
        counted += own
        sigmas |= {one.sample: move.sigma(own, one) for one in own}
    return counted, sigmas


@dataclass(frozen=True, eq=False)
class _Move:
    """One move compared with the session of the others; ``usual`` is their chi-square over its mean, at least 1."""

    obs: Observations
    state: SessionState
    m: int
    usual: float

    def misfit(self, losses: Sequence[Loss]) -> float:
        """Chi-square of gravity and velocity after the move with the lost samples inserted."""
        whole = with_inserted(self.obs, self.m, {one.sample: one.count for one in losses})
        return float((move_residuals(whole, self.state) ** 2).sum())

    def counted(self, losses: Sequence[Loss]) -> list[Loss]:
        """Losses with the counts that gravity determines; those that do not reduce the misfit, as a jolt that
        looks like a loss, are left out.

        Refined together, since one without the other has a wrong count; then the weakest is tried first.
        """
        own = self._refined(sorted(losses, key=lambda one: -one.gain))
        for one in sorted(losses, key=lambda one: one.gain):
            fewer = self._refined([other for other in own if other.sample != one.sample])
            own = own if self._fall(own, fewer) >= 2.0 * LN_FAULT else fewer
        # Gravity and velocity after the move are evidence as the joint of its two sides is.
        without = [[other for other in own if other is not one] for one in own]
        return [replace(one, gain=one.gain + self._fall(own, fewer)) for one, fewer in zip(own, without, strict=True)]

    def _refined(self, own: list[Loss]) -> list[Loss]:
        """The losses with their best counts, the last one first."""
        out = list(own)
        for k in reversed(range(len(out))):
            out[k] = self._best(out, k)
        return out

    def _fall(self, more: Sequence[Loss], fewer: Sequence[Loss]) -> float:
        """By how much the misfit is less with ``more``, in units of what remains of it and of that of the others."""
        best = self.misfit(more)
        return (self.misfit(fewer) - best) / max(best / ROWS, self.usual)

    def _best(self, own: list[Loss], k: int) -> Loss:
        best, least = own[k], self.misfit(own)
        for direction in (-1, 1):
            while 1 <= best.count + direction <= most_lost(self.obs.recording.rate_hz):
                other = replace(best, count=best.count + direction)
                value = self.misfit([*own[:k], other, *own[k + 1 :]])
                if value >= least:
                    break
                best, least = other, value
        return best

    def sigma(self, own: list[Loss], one: Loss) -> float:
        """Standard error of a count from the curvature of the misfit, widened by the remaining misfit of the move."""
        others, best = [other for other in own if other is not one], self.misfit(own)
        beside = [
            self.misfit([*others, replace(one, count=n)]) - best for n in (one.count - 1, one.count + 1) if n >= 1
        ]
        return float(max(0.3, np.sqrt(max(best / ROWS, 1.0) / max(float(np.mean(beside)), 1e-3))))


def _of_moves_that_agree(obs: Observations, state: SessionState, prior: Prior | None) -> SessionState:
    """The session without moves that contradict it: an undetected loss must not bias the reference of the others."""
    for _ in range(obs.n_moves):
        state = fit(obs, state, prior).state
        misfit = (move_residuals(obs, state) ** 2).sum(axis=1)
        bad = {int(m) for m in np.flatnonzero(misfit > CONTRADICTS * np.median(misfit))}
        if not bad or obs.n_moves - len(bad) < FEWEST_MOVES:
            return state
        obs = obs.without_moves(bad)
    return state


class DroppedSamples(DirectEffect):
    """Both sensors skip the same whole number of samples at once; with these inserted the motion is smooth."""

    id = "dropped-samples"
    needs_moves = True
    of_session = None

    def find(self, context: Context) -> Evidence | None:
        losses, sigmas = counted_losses(context)
        # A jolt looks like a loss; gravity then gives a count of zero, or one that is not significant.
        losses = [loss for loss in losses if loss.count > CLEAR * sigmas[loss.sample]]
        if not losses:
            return None
        obs = context.obs
        n_intervals = sum(b - a for a, b in obs.move_ranges)
        counts = {loss.sample: loss.count for loss in losses}
        t = obs.time_s
        total = float(np.sqrt(sum(sigmas[loss.sample] ** 2 for loss in losses)))
        parameters = (
            EffectParameter("events", float(len(losses)), 0.0, "1"),
            EffectParameter("samples_lost", float(sum(loss.count for loss in losses)), total, "1"),
            *(
                EffectParameter(f"lost_at_{t[one.sample]:.2f}s", float(one.count), sigmas[one.sample], "samples")
                for one in losses
            ),
        )
        largest = sorted(losses, key=lambda loss: -loss.count)[:MOST_NAMED]
        statement = self.reported(
            "losses", losses=[(loss.count, t[loss.sample]) for loss in largest],
            has_more=len(losses) > MOST_NAMED, more=len(losses) - MOST_NAMED,
        )  # fmt: skip

        where = Where(
            (),
            tuple(dict.fromkeys(obs.move_names([loss.move for loss in losses]))),
            tuple((float(t[loss.sample]), float(t[loss.sample + 1])) for loss in losses),
        )
        gain, clearest = sum(loss.gain for loss in losses), max(loss.gain for loss in losses)
        # Corrected for all intervals and counts.
        p = float(np.exp(-0.5 * clearest)) * n_intervals * most_lost(obs.recording.rate_hz)
        return Evidence(
            p, gain, parameters, statement, "timing", where,
            reweigh=lambda old: with_gaps(old, counts),
        )  # fmt: skip
