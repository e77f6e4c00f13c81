"""Response of the accelerometers that is not a straight line: of second order, of third order, bent at zero."""

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import ACCELEROMETER, Effect, Variant, on_axes, per_axis


class AccelQuadratic(Effect):
    """Adds K2 f² along each accelerometer's own axis: half a percent of g at 1 g."""

    id, size, applies_elsewhere = "accel-quadratic", 5e-4, True
    is_of_true_motion = True

    def variants(self, context: Context) -> list[Variant]:
        return _added(context, context.axis_force**2, "K2", "1/(m/s^2)")


class AccelCubic(Effect):
    """Adds K3 f³, the first odd term ξ/2 (1 + ξ²/4 + …) of a capacitive bridge: half a percent of g at 1 g."""

    id, size, applies_elsewhere = "accel-cubic", 5e-5, True
    is_of_true_motion = True

    def variants(self, context: Context) -> list[Variant]:
        return _added(context, context.axis_force**3, "K3", "1/(m/s^2)^2")


class AccelScaleAsymmetry(Effect):
    """Adds a |f|, half the difference between the scales of the two directions: half a percent."""

    id, size, applies_elsewhere = "accel-scale-asymmetry", 5e-3, True
    is_of_true_motion = True

    def variants(self, context: Context) -> list[Variant]:
        return _added(context, abs(context.axis_force), "half_difference", "1")


def _added(context: Context, values: FloatArray, symbol: str, unit: str) -> list[Variant]:
    return [Variant(on_axes(context, ACCELEROMETER, values), per_axis(symbol), (unit,) * 3)]
