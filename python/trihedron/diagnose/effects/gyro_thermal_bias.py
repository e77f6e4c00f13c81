"""Gyro bias that follows the logged temperature."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import LEAST_SWING_K, Context
from trihedron.diagnose.effects.contract import Effect, Variant, rate_only
from trihedron.diagnose.effects.thermal_shapes import thermal_bias_variants, thermal_sizes
from trihedron.records.words import why_not

BIAS_PER_K = 4e-4
"""rad/s: 0.02 °/s per kelvin."""


class GyroThermalBias(Effect):
    """Bias linear, then quadratic in temperature; with its rate of change, or a branch of its own while it cools."""

    id = "gyro-thermal-bias"
    leaves_open = ("gyro-bias",)
    drifts_as = "gyro-bias-drift"
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        if context.temperature is None:
            return why_not("no-temperature")
        if np.ptp(context.temperature) < LEAST_SWING_K:
            return why_not("steady-temperature", least_k=LEAST_SWING_K)
        return None

    def sizes(self, context: Context, variant: Variant) -> FloatArray:
        return thermal_sizes(context, variant, BIAS_PER_K)

    def variants(self, context: Context) -> list[Variant]:
        return thermal_bias_variants(context, context.on_gyros, rate_only, "rad/s")
