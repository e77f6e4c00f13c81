"""Accelerometer scale that differs between positive and negative force."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only, per_axis


class AccelScaleAsymmetry(Effect):
    """Adds a |f|: half the difference between the scales of the two directions."""

    id = "accel-scale-asymmetry"
    size = 5e-3
    """Half a percent."""
    applies_elsewhere = True

    def variants(self, context: Context) -> list[Variant]:
        columns = context.on_accelerometers(np.abs(context.axis_force))
        return [Variant(force_only(columns), per_axis("half_difference"), ("1",) * 3)]
