"""Rate of change of a slow signal, smoothed."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from trihedron.arrays import FloatArray

BLOCKS_OF_WIDTH = 10
"""Blocks whose means stand for a width of the smoothing: it is wider than its blocks by a part in 2400, and a window of
thousands of samples is one of dozens."""


def smoothed_slope(values: FloatArray, time_s: FloatArray, width: float) -> FloatArray:
    """(n,) rate of change, per second, of ``values`` (n,) smoothed by a Gaussian of ``width`` samples.

    Timestamps are smoothed alike: a straight line keeps its slope across pauses, and to the ends.
    """
    length = max(round(width / BLOCKS_OF_WIDTH), 1)
    starts = np.arange(0, len(values), length)
    if len(starts) < 2:
        return np.zeros(len(values))
    n = np.diff(starts, append=len(values))
    level, time = (np.add.reduceat(of, starts) / n for of in (values, time_s))
    smooth, at = (gaussian_filter1d(of, max(width / length, 1.0), mode="nearest") for of in (level, time))
    out: FloatArray = np.interp(time_s, time, np.gradient(smooth, at))
    return out
