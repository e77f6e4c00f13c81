"""Late readings: what a delay and a low-pass add, to all orders that a recording can determine.

A reading y that trails the truth x by a pure delay δ has x(t) = y(t + δ); after a low-pass of first order
x = y + τ y', of second order (Butterworth) x = y + τ y' + τ²/2 y''. All begin with τ y'; the next term separates
them. Columns are computed for a time of a grid and scale with their parameter, which must come out near one.
"""

from __future__ import annotations

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context

TIMES_S = (0.004, 0.008, 0.016, 0.032, 0.064)
"""Times tried, s, each twice the one before: a parameter from 1/√2 to √2 covers the times between."""
NEAR_ONE = (0.6, 1.6)
"""Range of a confirmed parameter: outside it another time of the grid fits better, or the mechanism does not."""
LEAST_STEPS = 0.25
"""In sample intervals: a shorter time constant decays by e⁻⁴ within a sample, and its column is that of a delay."""


def times_for(context: Context) -> tuple[float, ...]:
    """The times of the grid that the sampling resolves: a quarter of a sample at least."""
    step_s = 1.0 / context.obs.recording.rate_hz
    return tuple(t for t in TIMES_S if t >= LEAST_STEPS * step_s) or (TIMES_S[-1],)


def shifted(context: Context, values: FloatArray, ahead_s: float) -> FloatArray:
    """(points, 3) values at a time ``ahead_s`` later inside moves, constant beyond their ends; unchanged in poses.

    By a cubic spline per move with zero slope at its ends: linear interpolation would be a low-pass of its own.
    """
    return _core.move_shifted(
        context.time_s, np.ascontiguousarray(np.asarray_chkfinite(values)), context.move_edges, ahead_s
    )


def by_delay(context: Context, values: FloatArray, delay_s: float) -> FloatArray:
    """What a delay adds to readings: y(t) - y(t + δ)."""
    return values - shifted(context, values, delay_s)


def by_low_pass(context: Context, values: FloatArray, time_s: float) -> FloatArray:
    """What a second-order low-pass of this delay adds to readings: -(τ y' + τ²/2 y'')."""
    step = max(0.5 * time_s, 1.0 / context.obs.recording.rate_hz)
    twice = shifted(context, values, step) - 2.0 * values + shifted(context, values, -step)
    return -(time_s * context.derivative(values) + 0.5 * (time_s / step) ** 2 * twice)


def is_confirmed(value: FloatArray, covariance: FloatArray) -> bool:
    """Whether a scaled parameter is positive and near one (``NEAR_ONE``), within three standard errors."""
    sigma = 3.0 * float(np.sqrt(max(float(covariance[0, 0]), 0.0)))
    return bool(NEAR_ONE[0] - sigma < value[0] < NEAR_ONE[1] + sigma and value[0] > 0.0)
