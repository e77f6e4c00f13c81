"""Gyro bias that follows the logged temperature."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import LEAST_SWING_K, Context
from trihedron.diagnose.effects.contract import Effect, Variant, rate_only
from trihedron.diagnose.effects.thermal_shapes import thermal_bias_variants
from trihedron.diagnose.zeros.of_session import STANDS_OUT, gyro_evidence
from trihedron.records.words import why_not


class GyroThermalBias(Effect):
    """Bias linear, then quadratic in temperature; with its rate of change, or a branch of its own while it cools."""

    id = "gyro-thermal-bias"
    leaves_open = ("gyro-zero",)
    drifts_as = "gyro-hidden-drift"
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        if context.temperature is None:
            return why_not("no-temperature")
        if np.ptp(context.temperature) < LEAST_SWING_K:
            return why_not("steady-temperature", least_k=LEAST_SWING_K)
        return None

    def withstands(self, context: Context) -> bool:
        p = self.own_p_value(context)
        return p is None or p < STANDS_OUT

    def own_p_value(self, context: Context) -> float | None:
        found = gyro_evidence(context)
        thermal = None if found is None else found.evidence.groups.get("thermal")
        return None if thermal is None else thermal.p_value

    def variants(self, context: Context) -> list[Variant]:
        return thermal_bias_variants(context, context.on_gyros, rate_only, "rad/s")
