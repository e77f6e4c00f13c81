"""Steps and rate of timestamps before their kind is determined."""

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray


@dataclass(frozen=True)
class Steps:
    """Numbers of negative (``back``), zero (``same``) and positive steps (``forward``), and of missing timestamps."""

    back: int
    same: int
    forward: int
    missing: int


def steps_of(time_s: FloatArray) -> Steps:
    """Steps of timestamps (n,)."""
    return Steps(*_core.timestamp_steps(np.asarray(time_s, dtype=np.float64)))


def steps_of_counter(counter: FloatArray) -> FloatArray:
    """Steps (n - 1,) of a counter of 8, 16 or 32 bits, continued where it wraps."""
    step = np.diff(counter)
    bits = next((bits for bits in (8, 16, 32) if counter.max() < 2.0**bits), 0) if counter.min() >= 0 else 0
    return np.where(step < 0, step + 2.0**bits, step) if bits else step


def usual_step(time_s: FloatArray) -> float:
    """Median of the positive steps of timestamps (n,); NaN where there is none."""
    return _core.usual_step(np.asarray(time_s, dtype=np.float64))


def mean_rate_hz(time_s: FloatArray) -> float:
    """Samples per second outside gaps [Hz]; unbiased for timestamps that are rounded or shared by batches."""
    usual = usual_step(time_s)
    if steps_of(time_s).same > 0.2 * (len(time_s) - 1):
        step = np.diff(time_s)
        # Timestamps shared by batches: the number of samples before the last timestamp over their duration.
        before_last = int(np.searchsorted(time_s, time_s[-1]))
        return before_last / float(step[step <= 5.0 * usual].sum())
    count, total, *_ = _core.inside_steps(np.asarray(time_s, dtype=np.float64), -np.inf, 1.5 * usual)
    return count / total
