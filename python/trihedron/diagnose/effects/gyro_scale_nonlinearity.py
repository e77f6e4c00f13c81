"""Gyro scale that depends on rate."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, per_axis, rate_only

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
        cubic, square = context.on_gyros(w**3), context.on_gyros(w**2)
        both = np.concatenate([cubic, square], axis=2)
        c, q = per_axis("cubic"), per_axis("quadratic")
        cu, qu = ("1/(rad/s)^2",) * 3, ("1/(rad/s)",) * 3
        return [
            Variant(rate_only(cubic), c, cu, label="cubic"),
            Variant(rate_only(square), q, qu, label="quadratic"),
            Variant(rate_only(both), c + q, cu + qu, label="both"),
        ]
