"""Samples lost without a trace in the time timestamps."""

from __future__ import annotations

from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence, without_moves
from trihedron.diagnose.effects.sample_steps import MAX_LOST, Loss, find_losses
from trihedron.diagnose.session.observations import Observations, observe
from trihedron.diagnose.session.solve import fit, move_misfit
from trihedron.diagnose.session.state import NO_DISTORTION, SessionState
from trihedron.records import Recording, Segments
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Where

CLEAR_COUNT = 3.0
"""Standard errors by which a count must differ from none."""
UNSETTLED = 0.15
"""Relative error of a count that only the joint of the two sides tells."""
MOST_OF_INTERVALS = 0.02
"""Losses in more than one of fifty intervals are no losses here and there: the clock or the motion is another."""
NAMED = 4
"""Places that the sentence names."""
_KNOWN: WeakKeyDictionary[Observations, tuple[list[Loss], dict[int, float]]] = WeakKeyDictionary()


def counted_losses(context: Context) -> tuple[list[Loss], dict[int, float]]:
    """Losses with their counts, and the standard error of each count by its sample.

    The joint of the two sides tells where and roughly how many; gravity and rest after the move tell how many exactly:
    a turn whose middle is missing ends elsewhere. The twin is fitted without the moves concerned, so that a loss cannot
    bend what it is judged by. Searched once per set of observations.
    """
    if context.obs not in _KNOWN:
        losses = find_losses(context)
        counts, sigmas = _by_gravity(context, losses)
        _KNOWN[context.obs] = ([replace(one, count=counts[one.sample]) for one in losses], sigmas)
    return _KNOWN[context.obs]


def _by_gravity(context: Context, losses: list[Loss]) -> tuple[dict[int, int], dict[int, float]]:
    counts = {loss.sample: loss.count for loss in losses}
    sigmas = {loss.sample: 0.5 + UNSETTLED * loss.count for loss in losses}
    obs, state = context.obs, context.fitted.state
    ranges, poses = without_moves(obs.move_ranges, obs.move_poses, {loss.move for loss in losses})
    if not losses or len(ranges) < 3 or len(state.effect):
        return counts, sigmas
    clean = fit(
        replace(obs, move_ranges=ranges, move_poses=poses), state, NO_DISTORTION, context.fitted.line.prior
    ).state
    for m in sorted({loss.move for loss in losses}):
        own = sorted((loss for loss in losses if loss.move == m), key=lambda one: -one.gain)
        trial = {loss.sample: loss.count for loss in own}
        best = _misfit(obs, clean, m, trial)
        for _ in range(2 if len(own) > 1 else 1):  # losses in one move are counted in turn
            for loss in own:
                for direction in (-1, 1):
                    while 1 <= trial[loss.sample] + direction <= MAX_LOST:
                        moved = trial | {loss.sample: trial[loss.sample] + direction}
                        value = _misfit(obs, clean, m, moved)
                        if value >= best:
                            break
                        best, trial = value, moved
        for loss in own:
            n = trial[loss.sample]
            beside = [_misfit(obs, clean, m, trial | {loss.sample: k}) - best for k in (n - 1, n + 1) if k >= 1]
            # Misfit grows by one at one sigma; noise that a move shows beyond its own widens it.
            counts[loss.sample] = n
            sigmas[loss.sample] = float(max(0.3, np.sqrt(max(best / 5.0, 1.0) / max(float(np.mean(beside)), 1e-3))))
    return counts, sigmas


def _misfit(obs: Observations, state: SessionState, m: int, losses: dict[int, int]) -> float:
    """Chi-square of gravity and velocity after one move with samples put back behind those named."""
    a, b = obs.move_ranges[m]
    assert obs.raw_rate is not None
    force, rate, time = obs.raw_force[a:b], obs.raw_rate[a:b], obs.time_s[a:b]
    step = 1.0 / obs.recording.rate_hz
    for k, n in sorted(losses.items(), reverse=True):
        i = k - a
        force = np.concatenate([force[: i + 1], bridge(force, i, n), force[i + 1 :]])
        rate = np.concatenate([rate[: i + 1], bridge(rate, i, n), rate[i + 1 :]])
        put = time[i] + step * np.arange(1, n + 1)
        time = np.concatenate([time[: i + 1], put, time[i + 1 :] + n * step])
    one = replace(
        obs,
        time_s=time,
        raw_force=force,
        raw_rate=rate,
        move_ranges=((0, len(time)),),
        move_poses=obs.move_poses[m : m + 1],
    )
    return float(move_misfit(one, state)[0])


class DroppedSamples(DirectEffect):
    """Both sensors jump at once by the same whole number of samples; put back, the motion is smooth again."""

    id = "dropped-samples"
    needs_moves = True
    is_sought_again = True
    is_of_session = True

    def find(self, context: Context) -> Evidence | None:
        losses, sigmas = counted_losses(context)
        # A jolt looks like a loss; gravity then finds nothing missing, or cannot say how much.
        losses = [loss for loss in losses if loss.count > CLEAR_COUNT * sigmas[loss.sample]]
        if not losses:
            return None
        obs = context.obs
        n_intervals = sum(b - a for a, b in obs.move_ranges)
        if len(losses) > MOST_OF_INTERVALS * n_intervals:
            return None  # everywhere is not a loss here and there
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
        told = self.told(
            "losses", losses=[(loss.count, t[loss.sample]) for loss in losses[:NAMED]],
            has_more=len(losses) > NAMED, more=len(losses) - NAMED,
        )  # fmt: skip

        def reweigh(old: Observations) -> Observations:
            recording, segments = insert_samples(old.recording, old.segments, counts)
            mended = observe(recording, segments, old.averaging)
            return replace(mended, jitter_s=old.jitter_s)

        where = Where(
            (),
            tuple(dict.fromkeys(obs.move_names([loss.move for loss in losses]))),
            tuple((float(t[loss.sample]), float(t[loss.sample + 1])) for loss in losses),
        )
        gain = sum(loss.gain for loss in losses)
        # A chi-square of one degree of freedom, paid for by all intervals and counts looked at.
        weakest = min(max(loss.per_sensor) for loss in losses)
        p = float(np.clip(np.exp(-0.5 * weakest) * n_intervals * 60, 1e-300, 1.0))
        return Evidence(
            p, gain, parameters, told, "timing", where,
            reweigh=reweigh, touched=tuple(sorted({loss.move for loss in losses})),
        )  # fmt: skip


# Lost samples put back: a cubic bridge across every gap, timestamps and poses behind it moved.


def bridge(values: FloatArray, k: int, n: int) -> FloatArray:
    """(n, ...) samples between ``k`` and ``k + 1`` on a cubic Hermite through the two samples on either side."""
    if k < 1 or k + 2 >= len(values):
        return np.repeat(values[k : k + 1], n, axis=0)
    a, b = values[k], values[k + 1]
    da, db = values[k] - values[k - 1], values[k + 2] - values[k + 1]
    x = (np.arange(1, n + 1) / (n + 1)).reshape(-1, *([1] * (values.ndim - 1)))
    width = n + 1
    h00, h10 = 2 * x**3 - 3 * x**2 + 1, x**3 - 2 * x**2 + x
    h01, h11 = -2 * x**3 + 3 * x**2, x**3 - x**2
    out: FloatArray = h00 * a + h10 * width * da + h01 * b + h11 * width * db
    return out


def insert_samples(recording: Recording, segments: Segments, losses: dict[int, int]) -> tuple[Recording, Segments]:
    """Put ``n`` samples behind sample ``k`` for every ``k: n``, on a cubic through the two samples on either side.

    A cubic Hermite bridge keeps value and slope at both edges of the gap, so that the rotation integrated across it is
    right to the fifth power of its length. Time timestamps behind a gap move by what was lost.
    """
    n_old = recording.n_samples
    step = 1.0 / recording.rate_hz
    extra = np.zeros(n_old + 1, dtype=np.intp)
    for k, n in losses.items():
        extra[k + 1] += n
    shift = np.cumsum(extra)[:n_old]
    new_index = np.arange(n_old) + shift
    total = n_old + int(extra.sum())
    time_s = np.full(total, np.nan)
    time_s[new_index] = recording.time_s + shift * step
    gaps = np.isnan(time_s)
    time_s[gaps] = np.interp(np.flatnonzero(gaps), new_index, recording.time_s + shift * step)

    def bridged(values: FloatArray | None) -> FloatArray | None:
        if values is None:
            return None
        out = np.full((total, *values.shape[1:]), np.nan)
        out[new_index] = values
        for k, n in losses.items():
            out[k + shift[k] + 1 : k + shift[k] + 1 + n] = bridge(values, k, n)
        return out

    mended = replace(
        recording,
        time_s=time_s,
        accelerometer=bridged(recording.accelerometer),
        gyroscope=bridged(recording.gyroscope),
        temperature_degc=bridged(recording.temperature_degc),
        supply_v=bridged(recording.supply_v),
        auxiliary=type(recording.auxiliary)({}),
    ).knowing(recording.facts.moved(new_index))

    def at(index: int) -> int:
        return int(new_index[index]) if index < n_old else total

    poses = tuple(
        replace(
            pose,
            start=at(pose.start),
            stop=at(pose.stop - 1) + 1,
            outer_start=at(pose.outer_start),
            outer_stop=at(pose.outer_stop - 1) + 1,
            disturbed=tuple((at(a), at(b - 1) + 1) for a, b in pose.disturbed),
        )
        for pose in segments.poses
    )
    moves = tuple(
        replace(move, start=poses[move.pose_before].stop, stop=poses[move.pose_after].start) for move in segments.moves
    )
    mid = np.array([0.5 * (time_s[h.start] + time_s[h.stop - 1]) for h in poses])
    return mended, replace(segments, poses=poses, moves=moves, time_mid_s=mid, whole=None)
