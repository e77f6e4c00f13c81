"""A delay between the sensors, or a low-pass of one of them, to all orders that a recording can determine.

A reading y that trails the truth x by a pure delay δ has x(t) = y(t + δ); after a low-pass of first order
x = y + τ y', of second order (Butterworth) x = y + τ y' + τ²/2 y'', after a running mean over 2τ, which trails by τ,
x(t) = y(t + τ) - τ²/6 y''(t + τ). All begin with τ y'; the next term separates them.
Columns are computed for a time of a grid and scale with their parameter, which must come out near one.
"""

import numpy as np

from trihedron.arrays import FloatArray, sigmas_of
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import SENSORS, Effect, Variant, acting_on, on_axes, per_axis
from trihedron.diagnose.session.solve import Distortion

TIMES_S = (0.004, 0.008, 0.016, 0.032, 0.064)
"""Times tried, s, each twice the one before: a parameter from 1/√2 to √2 covers the times between."""
NEAR_ONE = (0.6, 1.6)
"""Range of a confirmed parameter: outside it another time of the grid fits better, or the mechanism does not."""
LEAST_STEPS = 0.25
"""In sample intervals: a shorter time constant decays by e⁻⁴ within a sample, and its column is that of a delay."""
SIGMAS = 3.0
"""Standard errors by which a lag may be negative: filters are causal."""
FIRST_ORDER_S = 0.01
"""s: unit of the first-order columns; their parameter is a lag in hundredths of a second."""
SECOND, MEAN = "second order", "running mean"
"""Shapes whose columns depend on the lag."""


def is_near_one(value: FloatArray, covariance: FloatArray) -> bool:
    """Whether a scaled parameter is near one, within three standard errors."""
    sigma = SIGMAS * float(np.sqrt(max(float(covariance[0, 0]), 0.0)))
    return bool(NEAR_ONE[0] - sigma < value[0] < NEAR_ONE[1] + sigma)


class SensorLag(Effect):
    """Lag τ of one sensor's reading behind the motion, of first order (also per axis) or second order."""

    id = "sensor-lag"
    needs_moves = True
    size = 0.015
    """s: the delay of a filter."""

    def variants(self, context: Context) -> list[Variant]:
        unit, out = FIRST_ORDER_S, []
        for sensor, slope in enumerate((context.force_rate, context.angular_acceleration)):
            columns = acting_on(sensor, -unit * slope[:, :, None])
            name = SENSORS[sensor].label
            out.append(Variant(columns, (f"{name}_lag",), ("s",), label=name, scale=unit))
        for sensor, label in enumerate(("accelerometer, per axis", "gyro, per axis")):
            columns = on_axes(context, sensor, -unit * context.derivative(context.axis_motion(sensor)))
            name = SENSORS[sensor].label
            out.append(Variant(columns, per_axis(f"{name}_lag"), ("s",) * 3, label=label, scale=unit))
        # A shorter time than the sampling resolves is that of a delay.
        least_s = LEAST_STEPS / context.obs.recording.rate_hz
        times = [t for t in TIMES_S if t >= least_s] or [TIMES_S[-1]]
        return out + [
            _filtered(context, sensor, t, f"{SENSORS[sensor].label}, {kind}, {1e3 * t:.0f} ms")
            for kind in (SECOND, MEAN)
            for t in times
            for sensor in range(2)
        ]

    def rescaled(self, context: Context, variant: Variant, value: FloatArray) -> Variant | None:
        if not _has_size(variant) or not value[0] > 0.0:
            return None
        sensor = int(variant.label.startswith(SENSORS[1].label))
        return _filtered(context, sensor, variant.scale * float(value[0]), variant.label)

    def is_plausible(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:
        sigma = sigmas_of(covariance)
        if (value < -SIGMAS * sigma).any() or not (value > 0.0).any():
            return False
        return not _has_size(variant) or is_near_one(value, covariance)


def _has_size(variant: Variant) -> bool:
    return SECOND in variant.label or MEAN in variant.label


def _filtered(context: Context, sensor: int, lag_s: float, label: str) -> Variant:
    """What a second-order low-pass of this lag, or a running mean over twice the lag, adds to readings.

    That of the gyro on a clock that is late by the lag: the accelerometer is early, and the rate keeps its phase. With
    the lag in the rate a fit that begins without one ends in another minimum.
    """
    values, late_s = (context.rate, lag_s) if sensor else (context.force, 0.0)
    step = max(0.5 * lag_s, 1.0 / context.obs.recording.rate_hz)
    at = (lag_s if MEAN in label else 0.0) - late_s
    here, after, before = (context.shifted(values, t) for t in (at, at + step, at - step))
    bent = (lag_s / step) ** 2 * (after - 2.0 * here + before)
    truth = here - bent / 6.0
    if SECOND in label:
        truth = here + lag_s * context.shifted(context.derivative(values), at) + 0.5 * bent
    column = (values - truth)[:, :, None]
    early = (context.force - context.shifted(context.force, -lag_s))[:, :, None]
    distortion = Distortion(early, column) if sensor else acting_on(0, column)
    return Variant(distortion, (f"{SENSORS[sensor].label}_lag",), ("s",), label=label, scale=lag_s)


class AccelGyroTimeOffset(Effect):
    """Accelerometer readings belong to an earlier instant: the reading at t is f(t − δ); at δ < 0 the gyro is late."""

    id = "accel-gyro-time-offset"
    needs_moves = True
    size = 0.015
    """s: one or two samples of a slow log, or the delay of a filter."""

    def variants(self, context: Context) -> list[Variant]:
        return [_offset(context, sign * t, f"{1e3 * sign * t:+.0f} ms") for t in TIMES_S for sign in (1.0, -1.0)]

    def rescaled(self, context: Context, variant: Variant, value: FloatArray) -> Variant | None:
        return _offset(context, variant.scale * float(value[0]), variant.label)

    def is_plausible(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:  # noqa: ARG002
        return is_near_one(value, covariance) and value[0] > 0.0


def _offset(context: Context, delay_s: float, label: str) -> Variant:
    """What a delay adds to readings: y(t) - y(t + δ)."""
    column = context.force - context.shifted(context.force, delay_s)
    return Variant(acting_on(0, column[:, :, None]), ("accelerometer_delay",), ("s",), label=label, scale=delay_s)
