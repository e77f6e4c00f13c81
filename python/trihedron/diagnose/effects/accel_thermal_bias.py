"""Accel bias that follows the logged temperature."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import LEAST_SWING_K, Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only
from trihedron.diagnose.effects.thermal_shapes import thermal_bias_variants


class AccelThermalBias(Effect):
    """Bias linear, then quadratic in temperature; with its rate of change, or a branch of its own while it cools."""

    id = "accel-thermal-bias"
    leaves_open = ("accel-zero",)
    drifts_as = "accel-hidden-drift"
    mechanism = "accelerometer bias follows the temperature"
    experiment = (
        "repeat one pose while the temperature both rises and falls: drift in time does not turn back, this does"
    )
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        if context.temperature is None:
            return "the log has no temperature"
        if np.ptp(context.temperature) < LEAST_SWING_K:
            return f"the temperature changes by less than {LEAST_SWING_K:g} °C"
        return None

    def variants(self, context: Context) -> list[Variant]:
        return thermal_bias_variants(context, context.on_accelerometers, force_only, "m/s^2")
