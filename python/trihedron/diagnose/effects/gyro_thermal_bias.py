"""Gyro bias that follows the logged temperature."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, per_axis, rate_only
from trihedron.diagnose.zeros.of_session import STANDS_OUT, gyro_evidence


class GyroThermalBias(Effect):
    """Bias linear, then quadratic, in temperature (about its mean over the holds)."""

    id = "gyro-thermal-bias"
    leaves_open = ("gyro-zero",)
    mechanism = "gyro bias follows the temperature"
    experiment = (
        "repeat one pose while the temperature both rises and falls: drift in time does not turn back, this does"
    )
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        if context.temperature is None:
            return "the log has no temperature"
        if np.ptp(context.temperature) < 0.2:
            return "the temperature changes by less than 0.2 °C"
        return None

    def withstands(self, context: Context) -> bool:
        found = gyro_evidence(context)
        thermal = None if found is None else found.evidence.groups.get("thermal")
        return thermal is None or thermal.p_value < STANDS_OUT

    def variants(self, context: Context) -> list[Variant]:
        assert context.temperature is not None
        t = context.temperature[:, None] * np.ones(3)
        linear = context.on_gyros(t)
        both = np.concatenate([linear, context.on_gyros(t**2)], axis=2)
        units = ("rad/s/K",) * 3
        return [
            Variant(rate_only(linear), per_axis("bias_per_kelvin"), units, label="linear"),
            Variant(
                rate_only(both),
                per_axis("bias_per_kelvin") + per_axis("bias_per_kelvin2"),
                units + ("rad/s/K^2",) * 3,
                label="quadratic",
            ),
        ]
