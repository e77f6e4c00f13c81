"""Gyro readings that depend on specific force, or not linearly on the rate."""

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import GYRO, Effect, Variant, acting_on, on_axes, per_axis
from trihedron.records.words import why_not
from trihedron.session.drift import PER_FORCE, by_force

LEAST_RATE = 1e-3
"""rad/s: lower bound of the fastest rate, for recordings without rotation."""


class GyroGSensitivity(Effect):
    """Rate bias linear in specific force: the gyro reads ω + G f."""

    id = "gyro-g-sensitivity"
    size = PER_FORCE
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        return why_not("no-gyro") if context.obs.raw_rate is None else None

    def variants(self, context: Context) -> list[Variant]:
        unit = "(rad/s)/(m/s^2)"
        columns = by_force(context.force)
        names = tuple(f"G_{i}{j}" for i in AXES for j in AXES)
        whole = Variant(acting_on(1, columns), names, (unit,) * 9)
        # One gyro axis of three may have it, or show it.
        rows = [
            Variant(acting_on(1, columns[:, :, 3 * k : 3 * k + 3]), names[3 * k : 3 * k + 3], (unit,) * 3, label=axis)
            for k, axis in enumerate(AXES)
        ]
        return [whole, *rows]


class GyroScaleNonlinearity(Effect):
    """Cubic (odd), quadratic (even), both, or another scale in either sense, along each gyro's own axis."""

    id = "gyro-scale-nonlinearity"
    needs_moves = True
    applies_elsewhere = True
    is_of_true_motion = True

    def sizes(self, context: Context, variant: Variant) -> FloatArray:
        # 1 % of the fastest rate.
        fastest = max(float(np.abs(context.axis_rate).max()), LEAST_RATE)
        per = {"c": 0.01 / fastest**2, "q": 0.01 / fastest, "h": 0.01}
        return np.array([per[name[0]] for name in variant.names])

    def variants(self, context: Context) -> list[Variant]:
        w = context.axis_rate
        c, q = per_axis("cubic"), per_axis("quadratic")
        cu, qu = ("1/(rad/s)^2",) * 3, ("1/(rad/s)",) * 3
        return [
            Variant(on_axes(context, GYRO, w**3), c, cu, label="cubic"),
            Variant(on_axes(context, GYRO, w**2), q, qu, label="quadratic"),
            Variant(on_axes(context, GYRO, w**3, w**2), c + q, cu + qu, label="both"),
            Variant(on_axes(context, GYRO, np.abs(w)), per_axis("half_difference"), ("1",) * 3, label="asymmetry"),
        ]
