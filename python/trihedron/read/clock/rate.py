"""Samples per second of stamps that nobody has judged yet."""

from __future__ import annotations

import numpy as np

from trihedron.read.table import FloatArray


def usual_step(time_s: FloatArray) -> float:
    """Median of the steps forward of stamps (n,); NaN where there is none."""
    step = np.diff(time_s)
    forward = step > 0
    if not forward.all():
        step = step[forward]
    # Where the steps lie: a copy would be one too many for a long log.
    return float(np.median(step, overwrite_input=True)) if len(step) else float("nan")


def mean_rate_hz(time_s: FloatArray) -> float:
    """Samples per second outside gaps: stamps rounded to a millisecond or batched do not bias it."""
    usual = usual_step(time_s)
    step = np.diff(time_s)
    if np.count_nonzero(step == 0) > 0.2 * len(step):
        # Stamped in batches: samples before the last stamp, over the time they took.
        before_last = int(np.searchsorted(time_s, time_s[-1]))
        return before_last / float(step[step <= 5.0 * usual].sum())
    is_inside = step <= 1.5 * usual
    inside = step if is_inside.all() else step[is_inside]
    return len(inside) / float(inside.sum())
