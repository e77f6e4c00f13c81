"""Losses of samples: intervals where the two sides join only if samples are inserted (eq. 8.16), and losses that quick
motion hides from that join, whose count gravity determines (eq. 8.16b)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.ndimage import percentile_filter

from trihedron.arrays import FloatArray, IntArray
from trihedron.diagnose.effects.direct import MUST_HALVE
from trihedron.diagnose.effects.plateaus import HALF_WINDOW, clipped_samples
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import move_residuals, wrt_lost_time
from trihedron.records import Recording, Segments
from trihedron.session.model import SessionState

MOST_LOST, LONGEST_LOSS_S = 60, 0.15
"""Longest gap, samples or seconds, whichever is more, that is tried: a fifth of a quick hand move."""
AGREEMENT = 30.0
"""Chi-square by which a smaller count may fit worse than the best: a large gap is no exact cubic."""
LEAST_GAIN = 40.0
"""Chi-square that a count of a hidden loss must gain: by chance once in 4·10⁹, once in 650 sessions."""
OVER_USUAL, LEFT_SHARE = 5.0, 0.1
"""The gain must be five times the usual chi-square of joins nearby (120 or more), and the remainder small: no loss is
found in 48 healthy sessions."""
NARROW = 3
"""Samples on either side that a join uses in quick motion."""
PLACE_S = 0.01
"""Spacing of the places tried, s."""
CUBIC, QUINTIC = 4, 6
"""Coefficients."""
MOST_IN_A_MOVE = 3
FEWEST_OF_PARABOLA = 6
"""Samples from which the slope of a parabola is more precise than the first step: twice its number of parameters."""


@dataclass(frozen=True)
class Loss:
    """Samples missing behind ``sample`` of ``move``: their number, and the chi-square that it gains."""

    sample: int
    move: int
    count: int
    gain: float


def most_lost(obs: Observations) -> int:
    """Largest number of samples tried at one place."""
    return max(MOST_LOST, round(LONGEST_LOSS_S * obs.recording.rate_hz))


@lru_cache(maxsize=4)
def _joints(w: int, order: int, most: int) -> FloatArray:
    """(counts, 2w, 2w) residual projectors of a polynomial of ``order`` coefficients across n missing samples."""
    projectors = []
    for n in range(most + 1):
        t = np.r_[np.arange(-w, 0) + 0.5, np.arange(w) + 0.5 + n] / (w + n / 2)
        q, _ = np.linalg.qr(np.vander(t - t.mean(), order))
        projectors.append(np.eye(2 * w) - q @ q.T)
    return np.stack(projectors)


def _windows(obs: Observations, samples: IntArray, w: int) -> list[FloatArray]:
    """(2w, k, axes) readings of each sensor, ``w`` on either side of the intervals that begin at ``samples`` (k,)."""
    return [np.stack([x[samples + o] for o in range(1 - w, w + 1)]) for x in obs.whitened]


def _trials(projectors: FloatArray, windows: list[FloatArray]) -> FloatArray:
    """(k, counts, sensors) chi-square of a polynomial across every count of missing samples: a projector is its own
    square."""
    out = []
    for one in windows:
        left = projectors.reshape(-1, len(one)) @ one.reshape(len(one), -1)
        left = left.reshape(len(projectors), *one.shape)
        out.append(np.einsum("nikc,nikc->kn", left, left))
    return np.stack(out, axis=2)


@lru_cache(maxsize=8)
def find_losses(obs: Observations) -> tuple[Loss, ...]:
    """Intervals where the motion on either side joins smoothly only if samples are inserted (eq. 8.16).

    For a trial count n one cubic is fitted to six samples before and six after, those after shifted by n steps. The
    count that fits all channels best is accepted if no sensor contradicts it and the remaining chi-square is usual.
    """
    losses = sorted((one for m in range(obs.n_moves) for one in _losses_of(obs, m)), key=lambda loss: -loss.gain)
    chosen: list[Loss] = []
    for loss in losses:
        if all(abs(loss.sample - other.sample) > 2 * HALF_WINDOW for other in chosen):
            chosen.append(loss)
    return tuple(sorted(chosen, key=lambda loss: loss.sample))


def _losses_of(obs: Observations, m: int) -> list[Loss]:
    (a, b), w, most = obs.move_ranges[m], HALF_WINDOW, most_lost(obs)
    k = a + np.arange(w - 1, b - a - w)
    k = k[~clipped_samples(obs)[k]]
    if len(k) == 0:
        return []
    stack = _joints(w, CUBIC, most)
    windows = _windows(obs, k, w)
    zero, dof = _trials(stack[:1], windows)[:, 0], 3 * (2 * w - CUBIC)
    # Usual chi-square of joins in motion as quick as here: jitter and curvature are no losses.
    near = [percentile_filter(one, 75, size=8 * w + 1, mode="nearest") for one in zero.T]
    usual = np.maximum(np.stack(near, axis=1), dof)
    # Only steps that stand out are searched; the quieter sensor may be too noisy to show the jump.
    suspect = np.flatnonzero((zero > 3.0 * usual).any(axis=1))
    if len(suspect) == 0:
        return []
    trial = _trials(stack, [v[:, suspect] for v in windows])
    # Quick motion over a wide gap is no cubic: a quintic is used where the cubic leaves too much.
    quick = (trial.min(axis=1) > 3.0 * usual[suspect]).any(axis=1)
    if quick.any():
        trial[quick] = _trials(_joints(w, QUINTIC, most), [v[:, suspect[quick]] for v in windows])
    total = trial.sum(axis=2)
    # Where the minimum is flat the smallest count is taken: the tilt error after the move gives the exact one.
    best = (total <= total.min(axis=1, keepdims=True) + AGREEMENT).argmax(axis=1)
    left, usual, zero = trial[np.arange(len(best)), best], usual[suspect], zero[suspect]
    gains = zero - left
    # More than a count gains where the signal is merely rough (vibration, jitter), and no sensor contradicts it.
    clear = (gains > OVER_USUAL * usual).any(axis=1) & (left < LEFT_SHARE * zero + 3.0 * usual).all(axis=1)
    found = np.flatnonzero(clear & (best > 0) & (best < most))
    return [Loss(int(k[suspect[i]]), m, int(best[i]), float(gains[i].sum())) for i in found]


def hidden_losses(obs: Observations, state: SessionState, m: int, usual: float, limit: float) -> list[Loss]:
    """Losses in one move that contradicts a session (``state``) beyond a chi-square of ``limit``, the largest first.

    A place and a count score by how well both sensors join there and by the misfit of gravity and velocity after the
    move, each in units of its usual chi-square: that of joins in this move, and ``usual`` of the other moves.
    """
    found: list[Loss] = []
    gain, places = _of_joints(obs, m)
    for _ in range(MOST_IN_A_MOVE if len(places) else 0):
        held = {one.sample: one.count for one in found}
        moved = with_inserted(obs, m, held)
        before = move_residuals(moved, state)[0]
        misfit = float(before @ before)
        if misfit <= limit:
            break
        free = np.array([all(abs(k - other) > 2 * NARROW for other in held) for k in places])
        after = places - obs.move_ranges[m][0] + sum(count * (places > sample) for sample, count in held.items())
        by_time = wrt_lost_time(moved, state, 0)
        by_sample = 0.5 * (by_time[after] + by_time[after + 1]) / obs.recording.rate_hz
        counts = np.arange(gain.shape[1])
        left = before + counts[None, :, None] * by_sample[:, None, :]
        score = gain + (misfit - (left**2).sum(axis=2)) / usual
        score[~free] = -np.inf
        at, n = np.unravel_index(int(score.argmax()), score.shape)
        loss = Loss(int(places[at]), m, int(n), float(score[at, n]))
        without = residual_after(obs, state, m, held | {loss.sample: loss.count})
        if gain[at, n] < LEAST_GAIN or float(without @ without) > MUST_HALVE * misfit:
            break  # nonlinear scale or a range limit: a better misfit alone does not prove a gap
        found.append(loss)
    return found


def _of_joints(obs: Observations, m: int) -> tuple[FloatArray, IntArray]:
    """(places, counts) chi-square that a count gains over zero at every place of a move, and the places (samples)."""
    a, b = obs.move_ranges[m]
    stride = max(1, round(PLACE_S * obs.recording.rate_hz))
    k = a + np.arange(NARROW - 1, b - a - NARROW, stride)
    k = k[~clipped_samples(obs)[k]]
    if not len(k):
        return np.zeros((0, 1)), k
    costs = _trials(_joints(NARROW, CUBIC, most_lost(obs)), _windows(obs, k, NARROW))
    ordinary = np.maximum(np.percentile(costs[:, :1], 75, axis=0) / (3 * (2 * NARROW - CUBIC)), 1.0)
    return ((costs[:, :1] - costs) / ordinary).sum(axis=2), k


def residual_after(obs: Observations, state: SessionState, m: int, losses: dict[int, int]) -> FloatArray:
    """(5,) residuals of gravity and velocity after one move with ``losses`` inserted, in standard errors."""
    return np.asarray(move_residuals(with_inserted(obs, m, losses), state)[0])


def with_inserted(obs: Observations, m: int, losses: dict[int, int]) -> Observations:
    """One move alone, with ``losses`` (counts after samples) inserted."""
    a, b = obs.move_ranges[m]
    assert obs.raw_rate is not None
    own = {k - a: n for k, n in losses.items()}
    time = with_time(obs.time_s[a:b], own, 1.0 / obs.recording.rate_hz)
    force, rate = (with_bridges(one[a:b], own) for one in (obs.raw_force, obs.raw_rate))
    ranges, poses = ((0, len(time)),), obs.move_poses[m : m + 1]
    return replace(obs, time_s=time, raw_force=force, raw_rate=rate, move_ranges=ranges, move_poses=poses)


def insert_samples(recording: Recording, segments: Segments, losses: dict[int, int]) -> tuple[Recording, Segments]:
    """Recording and segments with ``n`` samples inserted behind sample ``k`` for every ``k: n``."""
    place = moved(recording.n_samples, losses)
    time_s = with_time(recording.time_s, losses, 1.0 / recording.rate_hz)
    channels = ("accelerometer", "gyroscope", "temperature_degc", "supply_v")
    logged = {name: value for name in channels if (value := getattr(recording, name)) is not None}
    values: dict[str, Any] = {name: with_bridges(value, losses) for name, value in logged.items()}
    mended = replace(recording, time_s=time_s, auxiliary=type(recording.auxiliary)({}), **values)
    mended = mended.with_facts(recording.facts.moved(place))

    def at(index: int) -> int:
        return int(place[index]) if index < len(place) else len(time_s)

    poses = tuple(
        replace(
            pose, start=at(pose.start), stop=at(pose.stop - 1) + 1, outer_start=at(pose.outer_start),
            outer_stop=at(pose.outer_stop - 1) + 1,
            disturbed=tuple((at(a), at(b - 1) + 1) for a, b in pose.disturbed),
        )
        for pose in segments.poses
    )  # fmt: skip
    moves = tuple(
        replace(move, start=poses[move.pose_before].stop, stop=poses[move.pose_after].start) for move in segments.moves
    )
    mid = np.array([0.5 * (time_s[h.start] + time_s[h.stop - 1]) for h in poses])
    return mended, replace(segments, poses=poses, moves=moves, time_mid_s=mid, whole=None)


def moved(n: int, losses: dict[int, int]) -> IntArray:
    """(n,) places of samples once ``losses`` (counts after samples) are inserted."""
    extra = np.zeros(n, dtype=np.intp)
    extra[[k + 1 for k in losses]] = list(losses.values())
    return np.arange(n) + np.cumsum(extra)


def with_time(time_s: FloatArray, losses: dict[int, int], step_s: float) -> FloatArray:
    """Timestamps with those of the losses; behind a gap they move by the time lost."""
    place = moved(len(time_s), losses)
    return np.interp(np.arange(place[-1] + 1), place, time_s + (place - np.arange(len(place))) * step_s)


def with_bridges(values: FloatArray, losses: dict[int, int]) -> FloatArray:
    """Values (n, ...) with samples on a cubic across every loss."""
    place = moved(len(values), losses)
    out = np.empty((place[-1] + 1, *values.shape[1:]))
    out[place] = values
    for k, n in losses.items():
        out[place[k] + 1 : place[k + 1]] = bridge(values, k, n)
    return out


def bridge(values: FloatArray, k: int, n: int) -> FloatArray:
    """(n, ...) samples between ``k`` and ``k + 1`` on a cubic Hermite by the values and slopes on either side.

    The error of the rotation integrated across the gap is of fifth order in its length.
    """
    if k < 1 or k + 2 >= len(values):
        return np.repeat(values[k : k + 1], n, axis=0)
    a, da = _edge(values[max(k - max(n // 2, 1), 0) : k + 1][::-1])
    b, db = _edge(values[k + 1 : k + 2 + max(n // 2, 1)])
    da = -da
    x = (np.arange(1, n + 1) / (n + 1)).reshape(-1, *([1] * (values.ndim - 1)))
    width = n + 1
    h00, h10 = 2 * x**3 - 3 * x**2 + 1, x**3 - 2 * x**2 + x
    h01, h11 = -2 * x**3 + 3 * x**2, x**3 - x**2
    out: FloatArray = h00 * a + h10 * width * da + h01 * b + h11 * width * db
    return out


def _edge(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Value and slope at the first of the samples (m, ...), from a parabola where there are enough: the noise of a
    single step would be multiplied by the length of the gap."""
    if len(values) < FEWEST_OF_PARABOLA:
        return values[0], values[1] - values[0]
    x = np.arange(len(values))
    slope, value = np.polynomial.polynomial.polyfit(x, values.reshape(len(values), -1), 2)[1::-1]
    return value.reshape(values.shape[1:]), slope.reshape(values.shape[1:])
