"""Timestamps of one sensor late against those of the other."""

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only
from trihedron.diagnose.effects.sensor_lag import TIMES_S, is_near_one


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
    return Variant(force_only(column[:, :, None]), ("accelerometer_delay",), ("s",), label=label, scale=delay_s)
