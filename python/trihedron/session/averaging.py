"""What samples leave out: averaging over their interval, as decimating filters do (docs/model-session.md, 11.6d), and
motion faster than the samples (eq. 8.2a).

A mean m over the interval T differs from the value in its middle by T²/24 of the second derivative:
ω = m - a/24 (m₋ - 2 m + m₊), a = 1 for a sensor that averages, 0 for one that samples points. A filter adds twelve
times the variance of its impulse response in sample intervals: 7.6 by a first-order low-pass with its corner at 0.2 of
the rate, 0 by a Butterworth. For the angle of a move about one axis a does not matter; for rotations that do not
commute it does, and moves determine it.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.session.rounding import UNIFORM

GAP = 1.5
"""A step longer than this many usual ones has lost samples, as in the session model (its ``gaps``)."""
BLOCK = 1 << 16
"""Rows processed together, to bound the memory of intermediate arrays in a long log."""


def sharpened(readings: FloatArray, time_s: FloatArray, share: float) -> FloatArray:
    """(n, 3) readings at the middle of their interval, with averaging ``share`` (a)."""
    if share == 0.0:
        return readings
    steps = np.diff(time_s)
    # No second difference is taken across lost samples.
    is_whole = steps < GAP * np.median(steps)
    out = np.array(readings)
    for start in range(1, len(out) - 1, BLOCK):
        stop = min(start + BLOCK, len(out) - 1)
        second = np.diff(readings[start - 1 : stop + 1], 2, axis=0)
        is_known = (is_whole[start:stop] & is_whole[start - 1 : stop - 1])[:, None] & np.isfinite(second)
        out[start:stop] -= share * np.where(is_known, second / 24.0, 0.0)
    return out


def unresolved_variance(
    readings: FloatArray,
    move_ranges: Sequence[tuple[int, int]],
    pose_ranges: Iterable[Sequence[int]],
    step_s: float,
    quantum: FloatArray,
    time_s: FloatArray | None = None,
) -> FloatArray:
    """(moves, 3) variance, (raw unit · s)², of every move's integral by motion above half the sampling frequency.

    Raw ``readings`` (n, 3) of one sensor, half-open sample ranges. The power of the noise is that of the poses, at
    least that of rounding by the LSB ``quantum`` (3,); ``time_s`` (n,) shows gaps.
    """
    moves, poses = (np.array(list(of), dtype=np.int64).reshape(-1, 2) for of in (move_ranges, pose_ranges))
    is_gap = np.zeros(0, dtype=bool) if time_s is None else np.diff(time_s) > GAP * step_s
    after = np.flatnonzero(is_gap) + 1
    return _core.unresolved_power(readings, (moves, poses), after.tolist(), UNIFORM * quantum**2) * step_s**2
