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


RESET, EXACT = 100.0, 1.5
"""Usual steps between the last value before a wrap, continued, and a power of two or another modulus from which on a
counter was reset and did not wrap: samples lost at the wrap itself widen the distance, and a reset comes as close by
chance once in rows / 100 logs. Seconds of a minute, a day or a week and decimal counters are rarer, and exact."""
DECIMAL = tuple(
    sorted(
        {
            *(10.0**k for k in range(2, 13)),
            *(s * 10.0**k for s in (60, 3600, 43200, 86400, 604800) for k in (0, 3, 6, 9)),
        }
    )
)


def modulus_of(counter: FloatArray) -> float:
    """The modulus at which numbers (n,) wrap; 0 where their steps back are no wraps.

    A power of two, 2^8 or more, that the largest of whole numbers approaches; or another usual one to which the steps
    back add up to a usual step, unless the numbers begin again where the log began, as another recording does.
    """
    step, usual, largest = np.diff(counter), usual_step(counter), float(counter.max())
    back = np.flatnonzero(step < 0)
    if not len(back) or counter.min() < 0:
        return 0.0
    whole = usual - float(np.median(step[back]))
    decimal = min(DECIMAL, key=lambda modulus: abs(modulus - whole))
    if largest < decimal and abs(decimal - whole) <= EXACT * usual:
        return decimal if counter[0] - counter[back + 1].min() > EXACT * usual else 0.0
    binary = 2.0 ** max(8, int(largest).bit_length())
    return binary if binary - largest <= RESET * usual and np.all(counter == np.rint(counter)) else 0.0


def steps_of_counter(counter: FloatArray) -> FloatArray:
    """Steps (n - 1,) of a counter, continued where it wraps."""
    step = np.diff(counter)
    return np.where(step < 0, step + modulus_of(counter), step)


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
