"""Samples inserted into a recording where some were lost: places, timestamps, and readings on a cubic between."""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from trihedron.arrays import FloatArray, IntArray
from trihedron.diagnose.session.observations import Observations
from trihedron.records import Recording, Segments

FEWEST_OF_PARABOLA = 6
"""Samples from which the slope of a parabola is more precise than the first step: twice its number of parameters."""


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


def with_inserted(obs: Observations, m: int, losses: dict[int, int]) -> Observations:
    """One move alone, with ``losses`` (counts after samples) inserted."""
    a, b = obs.move_ranges[m]
    assert obs.raw_rate is not None
    own = {k - a: n for k, n in losses.items()}
    time = with_time(obs.time_s[a:b], own, 1.0 / obs.recording.rate_hz)
    force, rate = (with_bridges(one[a:b], own) for one in (obs.raw_force, obs.raw_rate))
    poses, unresolved = obs.move_poses[m : m + 1], obs.unresolved[m : m + 1]
    return replace(
        obs, time_s=time, raw_force=force, raw_rate=rate, move_ranges=((0, len(time)),), move_poses=poses,
        unresolved=unresolved,
    )  # fmt: skip


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
    return np.asarray(CubicHermiteSpline([0, n + 1], [a, b], [-da, db])(np.arange(1, n + 1)))


def _edge(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Value and slope at the first of the samples (m, ...), from a parabola where there are enough: the noise of a
    single step would be multiplied by the length of the gap."""
    if len(values) < FEWEST_OF_PARABOLA:
        return values[0], values[1] - values[0]
    x = np.arange(len(values))
    slope, value = np.polynomial.polynomial.polyfit(x, values.reshape(len(values), -1), 2)[1::-1]
    return value.reshape(values.shape[1:]), slope.reshape(values.shape[1:])
