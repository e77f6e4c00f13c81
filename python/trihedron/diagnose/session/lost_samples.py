"""Samples missing behind timestamps that do not show them: as gaps of time, or on a cubic while they are counted."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from trihedron.arrays import IntArray
from trihedron.diagnose.session.observations import Observations


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
    place, step_s = _places(b - a, {k - a: n for k, n in losses.items()}), 1.0 / obs.recording.rate_hz
    whole = np.arange(place[-1] + 1)
    time = np.interp(whole, place, obs.time_s[a:b] + (place - np.arange(b - a)) * step_s)
    force, rate = (CubicSpline(place, one[a:b])(whole) for one in (obs.raw_force, obs.raw_rate))
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
