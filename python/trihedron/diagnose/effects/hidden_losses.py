"""Losses that quick motion hides from the join of the two sides: gravity determines the count (eq. 8.16b)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.diagnose.effects.direct import MUST_HALVE
from trihedron.diagnose.effects.sample_steps import LEAST_GAIN, Loss, clipped_samples, joint_costs, most_lost
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import move_residuals, wrt_lost_time
from trihedron.diagnose.session.state import SessionState

NARROW = 3
"""Samples on either side that a join uses in quick motion."""
PLACE_S = 0.01
"""Spacing of the places tried, s."""
MOST_IN_A_MOVE = 3
FEWEST_OF_PARABOLA = 6
"""Samples from which the slope of a parabola is more precise than the first step: twice its number of parameters."""


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
        loss = Loss(int(places[at]), m, int(n), float(score[at, n]), (float(score[at, n]),))
        without = residual_after(obs, state, m, held | {loss.sample: loss.count})
        if gain[at, n] < LEAST_GAIN or float(without @ without) > MUST_HALVE * misfit:
            break  # nonlinear scale or a range limit: a better misfit alone does not prove a gap
        found.append(loss)
    return found


def _of_joints(obs: Observations, m: int) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """(places, counts) chi-square that a count gains over zero at every place of a move, and the places (samples)."""
    a, b = obs.move_ranges[m]
    stride = max(1, round(PLACE_S * obs.recording.rate_hz))
    k = np.arange(NARROW - 1, b - a - NARROW, stride)
    k = k[~clipped_samples(obs)[a + k]]
    if not len(k):
        return np.zeros((0, 1)), k
    costs = joint_costs(obs, a + k, NARROW, most_lost(obs))
    ordinary = np.maximum(np.percentile(costs[:, :1], 75, axis=0) / (3 * (2 * NARROW - 4)), 1.0)
    return ((costs[:, :1] - costs) / ordinary).sum(axis=2), a + k


def residual_after(obs: Observations, state: SessionState, m: int, losses: dict[int, int]) -> FloatArray:
    """(5,) residuals of gravity and velocity after one move with ``losses`` inserted, in standard errors."""
    out: FloatArray = move_residuals(with_inserted(obs, m, losses), state)[0]
    return out


def with_inserted(obs: Observations, m: int, losses: dict[int, int]) -> Observations:
    """One move alone, with ``losses`` (counts after samples) inserted."""
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
    return replace(
        obs,
        time_s=time,
        raw_force=force,
        raw_rate=rate,
        move_ranges=((0, len(time)),),
        move_poses=obs.move_poses[m : m + 1],
    )


def bridge(values: FloatArray, k: int, n: int) -> FloatArray:
    """(n, ...) samples between ``k`` and ``k + 1`` on a cubic Hermite by the values and slopes on either side."""
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
