"""Samples missing behind timestamps that do not show them: as gaps of time, or on a cubic while they are counted."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from trihedron.arrays import FloatArray, IntArray
from trihedron.diagnose.session.observations import Observations

FEWEST_OF_PARABOLA = 6
"""Samples from which the slope of a parabola is more precise than the first step: twice its number of parameters."""


def with_gaps(obs: Observations, losses: dict[int, int]) -> Observations:
    """The observations with ``n`` samples missing behind sample ``k`` for every ``k: n``, which their timestamps show:
    the integrals over such a gap are as uncertain as the motion beside it leaves them (eq. 11.6b)."""
    n = len(obs.time_s)
    time_s = obs.time_s + (_places(n, losses) - np.arange(n)) / obs.recording.rate_hz
    middle = np.array([0.5 * (time_s[pose.start] + time_s[pose.stop - 1]) for pose in obs.segments.poses])
    return replace(
        obs, time_s=time_s, pose_time_s=middle, segments=replace(obs.segments, time_mid_s=middle),
        recording=obs.recording.with_same_readings(time_s=time_s),
    )  # fmt: skip


def with_inserted(obs: Observations, m: int, losses: dict[int, int]) -> Observations:
    """One move alone, with samples on a cubic in place of ``losses``: as uncertain, however many are inserted."""
    a, b = obs.move_ranges[m]
    assert obs.raw_rate is not None
    own, step_s = {k - a: n for k, n in losses.items()}, 1.0 / obs.recording.rate_hz
    place = _places(b - a, own)
    time = np.interp(np.arange(place[-1] + 1), place, obs.time_s[a:b] + (place - np.arange(b - a)) * step_s)
    force, rate = (_with_bridges(one[a:b], place, own) for one in (obs.raw_force, obs.raw_rate))
    poses, unresolved = obs.move_poses[m : m + 1], obs.unresolved[m : m + 1]
    return replace(
        obs, time_s=time, raw_force=force, raw_rate=rate, move_ranges=((0, len(time)),), move_poses=poses,
        unresolved=unresolved,
    )  # fmt: skip


def _places(n: int, losses: dict[int, int]) -> IntArray:
    """(n,) places of samples among those that were taken."""
    extra = np.zeros(n, dtype=np.intp)
    extra[[k + 1 for k in losses]] = list(losses.values())
    return np.arange(n) + np.cumsum(extra)


def _with_bridges(values: FloatArray, place: IntArray, losses: dict[int, int]) -> FloatArray:
    """Values (n, ...) at their ``place`` (n,), with samples on a cubic across every loss."""
    out = np.empty((place[-1] + 1, *values.shape[1:]))
    out[place] = values
    for k, n in losses.items():
        out[place[k] + 1 : place[k + 1]] = _bridge(values, k, n)
    return out


def _bridge(values: FloatArray, k: int, n: int) -> FloatArray:
    """(n, ...) samples between ``k`` and ``k + 1`` on a cubic Hermite by the values and slopes on either side.

    The error of the rotation integrated across the gap is of fifth order in its length.
    """
    if k < 1 or k + 2 >= len(values):
        return np.repeat(values[k : k + 1], n, axis=0)
    a, da = _edge(values[max(k - max(n // 2, 1), 0) : k + 1][::-1])
    b, db = _edge(values[k + 1 : k + 2 + max(n // 2, 1)])
    return np.asarray(CubicHermiteSpline([0, n + 1], [a, b], [-da, db])(np.arange(1, n + 1)))


def _edge(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Value and slope at the first of the samples (m, ...), from a parabola where there are enough: the noise of a
    single step would be multiplied by the length of the gap."""
    if len(values) < FEWEST_OF_PARABOLA:
        return values[0], values[1] - values[0]
    x = np.arange(len(values))
    slope, value = np.polynomial.polynomial.polyfit(x, values.reshape(len(values), -1), 2)[1::-1]
    return value.reshape(values.shape[1:]), slope.reshape(values.shape[1:])
