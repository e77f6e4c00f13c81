"""Accelerometer scale that differs between positive and negative force."""

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import ACCELEROMETER, Effect, Variant, on_axes, per_axis


class AccelScaleAsymmetry(Effect):
    """Adds a |f|: half the difference between the scales of the two directions."""

    id = "accel-scale-asymmetry"
    size = 5e-3
    """Half a percent."""
    applies_elsewhere = True

    def variants(self, context: Context) -> list[Variant]:
        size = on_axes(context, ACCELEROMETER, abs(context.axis_force))
        return [Variant(size, per_axis("half_difference"), ("1",) * 3)]
