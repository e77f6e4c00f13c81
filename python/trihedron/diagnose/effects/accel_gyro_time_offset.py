"""Timestamps of one sensor late against those of the other."""

from __future__ import annotations

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only
from trihedron.diagnose.effects.late_readings import TIMES_S, by_delay, is_confirmed


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

    def is_plausible(self, value: FloatArray, covariance: FloatArray) -> bool:
        return is_confirmed(value, covariance)


def _offset(context: Context, delay_s: float, label: str) -> Variant:
    columns = force_only(by_delay(context, context.force, delay_s)[:, :, None])
    return Variant(columns, ("accelerometer_delay",), ("s",), label=label, scale=delay_s)
