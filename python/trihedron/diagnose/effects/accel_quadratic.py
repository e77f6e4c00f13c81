"""Second-order response of the accelerometers."""

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import ACCELEROMETER, Effect, Variant, on_axes, per_axis


class AccelQuadratic(Effect):
    """Adds K2 f² along each accelerometer's own axis."""

    id = "accel-quadratic"
    size = 5e-4
    """1/(m/s²): half a percent of g at 1 g."""
    applies_elsewhere = True

    def variants(self, context: Context) -> list[Variant]:
        square = on_axes(context, ACCELEROMETER, context.axis_force**2)
        return [Variant(square, per_axis("K2"), ("1/(m/s^2)",) * 3)]
