"""Odd-order response of the accelerometers: a capacitive bridge beyond first order."""

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import ACCELEROMETER, Effect, Variant, on_axes, per_axis


class AccelCubic(Effect):
    """Adds K3 f³ along each axis: the first odd term of ξ/2 (1 + ξ²/4 + …)."""

    id = "accel-cubic"
    size = 5e-5
    """1/(m/s²)²: half a percent of g at 1 g."""
    applies_elsewhere = True

    def variants(self, context: Context) -> list[Variant]:
        cube = on_axes(context, ACCELEROMETER, context.axis_force**3)
        return [Variant(cube, per_axis("K3"), ("1/(m/s^2)^2",) * 3)]
