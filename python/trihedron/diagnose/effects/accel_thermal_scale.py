"""Accel scale that follows the logged temperature."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import LEAST_SWING_K, Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only, per_axis
from trihedron.records.words import why_not


class AccelThermalScale(Effect):
    """Relative scale linear in temperature (about its mean over the holds)."""

    id = "accel-thermal-scale"
    size = 3e-4
    """1/K: 300 ppm."""
    leaves_open = ("accel-bias", "accel-scale")
    drifts_as = "accel-bias-drift"
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        if context.temperature is None:
            return why_not("no-temperature")
        if np.ptp(context.temperature) < LEAST_SWING_K:
            return why_not("steady-temperature", least_k=LEAST_SWING_K)
        return None

    def variants(self, context: Context) -> list[Variant]:
        assert context.temperature is not None
        columns = context.on_accelerometers(context.temperature[:, None] * context.axis_force)
        return [Variant(force_only(columns), per_axis("scale_per_kelvin"), ("1/K",) * 3)]
