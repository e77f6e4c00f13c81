"""A first-order low-pass in one of the sensors."""

from __future__ import annotations

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only, per_axis, rate_only


class SensorLag(Effect):
    """Per-axis lag of one sensor: to first order its reading trails by τ times its derivative."""

    id = "sensor-lag"
    mechanism = "one sensor follows the motion through a low-pass filter"
    experiment = (
        "shake the sensor about one axis at several frequencies: a delay grows with frequency, a low-pass saturates"
    )

    def unavailable(self, context: Context) -> str | None:
        return "the log has no moves with a gyro" if not context.moves else None

    def variants(self, context: Context) -> list[Variant]:
        force, rate = -context.force_rate[:, :, None], -context.angular_acceleration[:, :, None]
        accel = context.on_accelerometers(-context.derivative(context.axis_force))
        gyro = context.on_gyros(-context.derivative(context.axis_rate))
        return [
            Variant(force_only(force), ("accelerometer_lag",), ("s",), label="accelerometer"),
            Variant(rate_only(rate), ("gyro_lag",), ("s",), label="gyro"),
            Variant(force_only(accel), per_axis("accelerometer_lag"), ("s",) * 3, label="accelerometer, per axis"),
            Variant(rate_only(gyro), per_axis("gyro_lag"), ("s",) * 3, label="gyro, per axis"),
        ]
