"""Accel scale that follows the logged temperature."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import LEAST_SWING_K, Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only, per_axis


class AccelThermalScale(Effect):
    """Relative scale linear in temperature (about its mean over the holds)."""

    id = "accel-thermal-scale"
    leaves_open = ("accel-zero", "accel-scale")
    drifts_as = "accel-hidden-drift"
    mechanism = "accelerometer scale follows the temperature"
    experiment = "repeat the same faces and turns at two temperatures"
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        if context.temperature is None:
            return "the log has no temperature"
        if np.ptp(context.temperature) < LEAST_SWING_K:
            return f"the temperature changes by less than {LEAST_SWING_K:g} °C"
        return None

    def variants(self, context: Context) -> list[Variant]:
        assert context.temperature is not None
        columns = context.on_accelerometers(context.temperature[:, None] * context.axis_force)
        return [Variant(force_only(columns), per_axis("scale_per_kelvin"), ("1/K",) * 3)]
