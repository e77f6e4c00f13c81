"""Readings that are no straight line of the motion, and gyros that read specific force."""

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import ACCELEROMETER, GYRO, Effect, Variant, acting_on, on_axes
from trihedron.session.drift import PER_FORCE, by_force


class _Bent(Effect):
    """A response that bends along each sensor's own axis."""

    applies_elsewhere = True
    is_of_true_motion = True


class AccelQuadratic(_Bent):
    """Adds K2 f² along each accelerometer's own axis: half a percent of g at 1 g."""

    id, size = "accel-quadratic", 5e-4

    def variants(self, context: Context) -> list[Variant]:
        return [on_axes(context, ACCELEROMETER, ("K2", context.axis_force**2, "1/(m/s^2)"))]


class AccelCubic(_Bent):
    """Adds K3 f³, the first odd term ξ/2 (1 + ξ²/4 + …) of a capacitive bridge: half a percent of g at 1 g."""

    id, size = "accel-cubic", 5e-5

    def variants(self, context: Context) -> list[Variant]:
        return [on_axes(context, ACCELEROMETER, ("K3", context.axis_force**3, "1/(m/s^2)^2"))]


class AccelScaleAsymmetry(_Bent):
    """Adds a |f|, half the difference between the scales of the two directions: half a percent."""

    id, size = "accel-scale-asymmetry", 5e-3

    def variants(self, context: Context) -> list[Variant]:
        return [on_axes(context, ACCELEROMETER, ("half_difference", abs(context.axis_force), "1"))]


class GyroScaleNonlinearity(_Bent):
    """Cubic (odd), quadratic (even), both, or another scale in either sense, along each gyro's own axis."""

    id = "gyro-scale-nonlinearity"
    needs_moves = True

    def sizes(self, context: Context, variant: Variant) -> FloatArray:
        # 1 % of the fastest rate.
        fastest = float(np.abs(context.axis_rate).max()) or 1.0
        per = {"c": 0.01 / fastest**2, "q": 0.01 / fastest, "h": 0.01}
        return np.array([per[name[0]] for name in variant.names])

    def variants(self, context: Context) -> list[Variant]:
        w = context.axis_rate
        cubic, quadratic = ("cubic", w**3, "1/(rad/s)^2"), ("quadratic", w**2, "1/(rad/s)")
        each = [on_axes(context, GYRO, one, label=one[0]) for one in (cubic, quadratic)]
        half = "half_difference", np.abs(w), "1"
        return [
            *each, on_axes(context, GYRO, cubic, quadratic, label="both"),
            on_axes(context, GYRO, half, label="asymmetry"),
        ]  # fmt: skip


class GyroGSensitivity(Effect):
    """Rate bias linear in specific force: the gyro reads ω + G f."""

    id = "gyro-g-sensitivity"
    size = PER_FORCE
    applies_elsewhere = True
    needs_gyro = True

    def variants(self, context: Context) -> list[Variant]:
        columns, unit = by_force(context.force), "(rad/s)/(m/s^2)"
        names = tuple(f"G_{i}{j}" for i in AXES for j in AXES)
        # One gyro axis of three may have it, or show it.
        parts = {"": slice(9), **{axis: slice(3 * k, 3 * k + 3) for k, axis in enumerate(AXES)}}
        return [
            Variant(acting_on(GYRO, columns[:, :, at]), names[at], (unit,) * len(names[at]), label=label)
            for label, at in parts.items()
        ]
