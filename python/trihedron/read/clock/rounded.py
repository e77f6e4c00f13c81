"""Samples numbered by their timestamps' own steps, where rounding to a grid is all that is wrong with them."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray, IntArray

COARSEST = 1.0 / 3.0
"""Of a period: on a grid this fine a step says how many samples it holds, both its ends rounded."""
ROOM = 0.36
"""Of a period, by which a step may miss whole periods: the coarsest grid, and a little that is not rounding."""
SINGLE = 1.5
"""Of the median step: longer ones hold a lost sample."""
COUNTED = 5.5
"""Periods of the longest steps that are looked at: those of pauses bear no clock's drift."""


def numbers_of_rounded(time_s: FloatArray, grid_s: float) -> IntArray | None:
    """(n,) numbers of the samples, lost ones counted, where every step is nearly whole periods; else ``None``.

    With T = 9.996 ms on a grid of 1 ms one step in 250 is a millisecond short: no phase sum over a window tells that
    pattern from a clock of another period with samples lost; the steps themselves do.
    """
    step = np.diff(time_s)
    middle = float(np.median(step))
    if not 0.0 < grid_s <= COARSEST * middle:
        return None
    period = float(np.mean(step[step < SINGLE * middle]))
    count = np.rint(step / period)
    if count.min() < 1.0 or count.max() > np.iinfo(np.int32).max:
        return None
    miss = np.abs(step - count * period)
    if np.any(miss[count < COUNTED] > ROOM * period):
        return None
    return np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
