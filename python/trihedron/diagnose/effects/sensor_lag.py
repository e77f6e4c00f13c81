"""A low-pass of first or second order in one of the sensors."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only, per_axis, rate_only
from trihedron.diagnose.effects.late_readings import NEAR_ONE, by_low_pass, times_for

SIGMAS = 3.0
"""Standard errors by which a lag may be negative: filters are causal."""


class SensorLag(Effect):
    """Lag τ of one sensor's reading behind the motion, of first order (also per axis) or second order."""

    id = "sensor-lag"
    needs_moves = True
    size = 0.015
    """s: the delay of a filter."""

    def variants(self, context: Context) -> list[Variant]:
        unit = FIRST_ORDER_S
        force, rate = -unit * context.force_rate[:, :, None], -unit * context.angular_acceleration[:, :, None]
        accel = context.on_accelerometers(-unit * context.derivative(context.axis_force))
        gyro = context.on_gyros(-unit * context.derivative(context.axis_rate))
        out = [
            Variant(force_only(force), ("accelerometer_lag",), ("s",), label="accelerometer", scale=unit),
            Variant(rate_only(rate), ("gyro_lag",), ("s",), label="gyro", scale=unit),
            Variant(force_only(accel), per_axis("accelerometer_lag"), ("s",) * 3, label="accelerometer, per axis",
                    scale=unit),
            Variant(rate_only(gyro), per_axis("gyro_lag"), ("s",) * 3, label="gyro, per axis", scale=unit),
        ]  # fmt: skip
        out += [
            _second_order(context, name, t, f"{name}, {SECOND}, {1e3 * t:.0f} ms")
            for t in times_for(context)
            for name in ("accelerometer", "gyro")
        ]
        return out

    def rescaled(self, context: Context, variant: Variant, value: FloatArray) -> Variant | None:
        if SECOND not in variant.label or not value[0] > 0.0:
            return None
        name = variant.label.split(",")[0]
        return _second_order(context, name, variant.scale * float(value[0]), variant.label)

    def is_plausible_variant(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:
        sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        if (value < -SIGMAS * sigma).any() or not (value > 0.0).any():
            return False
        if SECOND not in variant.label:
            return True
        low, high = NEAR_ONE
        return bool(low - SIGMAS * sigma[0] < value[0] < high + SIGMAS * sigma[0])


SECOND = "second order"


def _second_order(context: Context, name: str, time_s: float, label: str) -> Variant:
    is_accelerometer = name == "accelerometer"
    columns = by_low_pass(context, context.force if is_accelerometer else context.rate, time_s)[:, :, None]
    only = force_only if is_accelerometer else rate_only
    return Variant(only(columns), (f"{name}_lag",), ("s",), label=label, scale=time_s, is_family=True)


FIRST_ORDER_S = 0.01
"""s: unit of the first-order columns; their parameter is a lag in hundredths of a second."""
