"""One sensor stamped late against the other."""

from __future__ import annotations

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only


class AccelGyroTimeOffset(Effect):
    """Accelerometer readings belong to an earlier instant: f(t) reads f(t − δ)."""

    id = "accel-gyro-time-offset"
    mechanism = "accelerometer and gyro samples with the same time stamp belong to different instants"
    experiment = (
        "shake the sensor about one axis at several frequencies: a delay grows with frequency, a low-pass saturates"
    )

    def unavailable(self, context: Context) -> str | None:
        return "the log has no moves with a gyro" if not context.moves else None

    def variants(self, context: Context) -> list[Variant]:
        return [Variant(force_only(-context.force_rate[:, :, None]), ("accelerometer_delay",), ("s",))]
