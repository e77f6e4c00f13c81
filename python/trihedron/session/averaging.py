"""Sensors that average over the sample interval, as decimating filters do (docs/model-session.md, 11.6d).

A mean m over the interval T differs from the value in its middle by T²/24 of the second derivative:
ω = m - a/24 (m₋ - 2 m + m₊), a = 1 for a sensor that averages, 0 for one that samples points. For the angle of a move
about one axis, a sum of means, a does not matter; for rotations that do not commute it does, and moves determine it.
"""

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.session.aliasing import GAP

EITHER = 0.5
"""Prior mean and standard deviation of ``a``: a sensor of either kind is one standard deviation off."""
BLOCK = 1 << 16
"""Rows processed together, to bound the memory of intermediate arrays in a long log."""


def sharpened(readings: FloatArray, time_s: FloatArray, share: float) -> FloatArray:
    """(n, 3) readings at the middle of their interval, with averaging ``share`` (a) between 0 and 1."""
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
