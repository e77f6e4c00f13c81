"""Sensors that average over the sample interval, as many do whose filter decimates (docs/model-session.md, 11.6d).

A mean m over the interval T is the value in its middle but for T²/24 of its second derivative: ω = m - a/24 (m₋ - 2 m +
m₊), a = 1 of a sensor that averages, 0 of one that samples points. The turn over a move, a sum of means, knows no
difference; rotations that do not commute do. Which sensor it is, moves show as far as it matters.
"""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray

EITHER = 0.5
"""Prior mean and standard deviation of ``a``: a sensor of either kind is one standard deviation off."""
BLOCK = 1 << 16
"""Rows sharpened together: what is needed in between never takes the memory of a long log again."""
GAP = 1.5
"""A step longer than this many usual ones has lost samples: there is no second difference across."""


def sharpened(readings: FloatArray, time_s: FloatArray, share: float) -> FloatArray:
    """(n, 3) readings with ``share`` of what means over their interval lose of the value in its middle given back."""
    if share == 0.0:
        return readings
    steps = np.diff(time_s)
    is_whole = steps < GAP * np.median(steps)
    out = np.array(readings)
    for start in range(1, len(out) - 1, BLOCK):
        stop = min(start + BLOCK, len(out) - 1)
        second = np.diff(readings[start - 1 : stop + 1], 2, axis=0)
        is_known = (is_whole[start:stop] & is_whole[start - 1 : stop - 1])[:, None] & np.isfinite(second)
        out[start:stop] -= share * np.where(is_known, second / 24.0, 0.0)
    return out
