"""Samples per second of stamps that nobody has judged yet."""

from __future__ import annotations

import numpy as np

from trihedron.read.table import FloatArray


def mean_rate_hz(time_s: FloatArray) -> float:
    """Samples per second outside gaps: stamps rounded to a millisecond or batched do not bias it."""
    step = np.diff(time_s)
    positive = step[step > 0]
    usual = float(np.median(positive))
    if np.count_nonzero(step == 0) > 0.2 * len(step):
        # Stamped in batches: samples before the last stamp, over the time they took.
        before_last = int(np.searchsorted(time_s, time_s[-1]))
        return before_last / float(step[step <= 5.0 * usual].sum())
    inside = step[step <= 1.5 * usual]
    return len(inside) / float(inside.sum())
