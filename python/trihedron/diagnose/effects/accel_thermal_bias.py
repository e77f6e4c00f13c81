"""Accel bias that follows the logged temperature."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only, per_axis


class AccelThermalBias(Effect):
    """Bias linear, then quadratic, in temperature (about its mean over the holds)."""

    id = "accel-thermal-bias"
    leaves_open = ("accel-zero",)
    mechanism = "accelerometer bias follows the temperature"
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

    def variants(self, context: Context) -> list[Variant]:
        assert context.temperature is not None
        t = context.temperature[:, None] * np.ones(3)
        linear = context.on_accelerometers(t)
        both = np.concatenate([linear, context.on_accelerometers(t**2)], axis=2)
        units = ("m/s^2/K",) * 3
        return [
            Variant(force_only(linear), per_axis("bias_per_kelvin"), units, label="linear"),
            Variant(
                force_only(both),
                per_axis("bias_per_kelvin") + per_axis("bias_per_kelvin2"),
                units + ("m/s^2/K^2",) * 3,
                label="quadratic",
            ),
        ]
