"""Commands of a rate table: samples on a plateau, where the table has reached the commanded rate."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.reference.together import Grid, Reference

GUARD_S = 0.2
"""Least time excluded on either side of a command: commands are timestamped by another computer."""
LEVELS = 6.0
"""Robust sigmas from the plateau's median above which a sample is not on it: the table still accelerates."""


def plateaus(grid: Grid, reference: Reference, time: FloatArray) -> BoolArray:
    """(n,) True from where the gyro has reached the level that it keeps until the next command."""
    out = np.zeros(len(time), dtype=bool)
    row = np.searchsorted(reference.motion.time_s, time, side="right")
    guard = int(np.ceil(GUARD_S / grid.step_s))
    for command in np.unique(row):
        inside = np.flatnonzero(row == command)
        if len(inside) < 6 * guard:
            continue
        inside = inside[guard:-guard]
        raw = grid.gyroscope[inside]
        later = raw[len(raw) // 3 :]
        level = np.median(later, axis=0)
        sigma = 1.4826 * np.median(np.abs(later - level), axis=0) + 1e-12 * np.abs(level).max() + 1e-300
        smooth = running_mean(np.abs(raw - level) / sigma, max(guard // 2, 1))
        off = np.flatnonzero(np.any(smooth > LEVELS, axis=1))
        begin = off[off < len(raw) // 3]
        first = int(begin[-1]) + guard if len(begin) else 0
        out[inside[first:]] = True
    return out


def running_mean(x: FloatArray, n: int) -> FloatArray:
    """Centred means (k, c) of ``n`` rows of ``x`` (k, c), of fewer at its ends."""
    total = np.cumsum(np.vstack([np.zeros((1, x.shape[1])), x]), axis=0)
    at = np.arange(len(x))
    low, high = np.maximum(at - n // 2, 0), np.minimum(at - n // 2 + n, len(x))
    return np.asarray((total[high] - total[low]) / np.maximum(high - low, 1)[:, None])
