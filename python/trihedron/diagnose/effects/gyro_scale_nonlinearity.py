"""Gyro scale that depends on rate."""

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import GYRO, Effect, Variant, on_axes, per_axis

LEAST_RATE = 1e-3
"""rad/s: lower bound of the fastest rate, for recordings without rotation."""


class GyroScaleNonlinearity(Effect):
    """Cubic (odd), quadratic (even), or both, along each gyro's own axis."""

    id = "gyro-scale-nonlinearity"
    needs_moves = True
    applies_elsewhere = True

    def sizes(self, context: Context, variant: Variant) -> FloatArray:
        # 1 % of the fastest rate.
        fastest = max(float(np.abs(context.axis_rate).max()), LEAST_RATE)
        per = {"c": 0.01 / fastest**2, "q": 0.01 / fastest}
        return np.array([per[name[0]] for name in variant.names])

    def variants(self, context: Context) -> list[Variant]:
        w = context.axis_rate
        c, q = per_axis("cubic"), per_axis("quadratic")
        cu, qu = ("1/(rad/s)^2",) * 3, ("1/(rad/s)",) * 3
        return [
            Variant(on_axes(context, GYRO, w**3), c, cu, label="cubic"),
            Variant(on_axes(context, GYRO, w**2), q, qu, label="quadratic"),
            Variant(on_axes(context, GYRO, w**3, w**2), c + q, cu + qu, label="both"),
        ]
