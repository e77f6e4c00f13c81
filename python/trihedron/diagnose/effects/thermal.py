"""What follows a logged temperature: one effect, of either sensor, of its bias or of its scale."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import LEAST_SWING_K, Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only, per_axis, rate_only
from trihedron.diagnose.effects.thermal_shapes import thermal_bias_variants, thermal_sizes
from trihedron.records.words import why_not


class Thermal(Effect):
    """Seen where a temperature was logged and moved."""

    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        if context.temperature is None:
            return why_not("no-temperature")
        if np.ptp(context.temperature) < LEAST_SWING_K:
            return why_not("steady-temperature", least_k=LEAST_SWING_K)
        return None


class AccelThermalScale(Thermal):
    """Relative scale linear in temperature (about its mean over the holds)."""

    id = "accel-thermal-scale"
    size = 3e-4
    """1/K: 300 ppm."""
    leaves_open = ("accel-zero", "accel-scale")
    drifts_as = "accel-hidden-drift"

    def variants(self, context: Context) -> list[Variant]:
        assert context.temperature is not None
        columns = context.on_accelerometers(context.temperature[:, None] * context.axis_force)
        return [Variant(force_only(columns), per_axis("scale_per_kelvin"), ("1/K",) * 3)]


class GyroThermalScale(Thermal):
    """The same of the gyro."""

    id = "gyro-thermal-scale"
    size = 3e-4
    leaves_open = ("gyro-zero", "gyro-scale")
    drifts_as = "gyro-hidden-drift"

    def variants(self, context: Context) -> list[Variant]:
        assert context.temperature is not None
        columns = context.on_gyros(context.temperature[:, None] * context.axis_rate)
        return [Variant(rate_only(columns), per_axis("scale_per_kelvin"), ("1/K",) * 3)]


class AccelThermalBias(Thermal):
    """Bias linear, then quadratic in temperature; with its rate of change, or a branch of its own while it cools."""

    id = "accel-thermal-bias"
    leaves_open = ("accel-zero",)
    drifts_as = "accel-hidden-drift"
    per_kelvin = 0.005
    """m/s²: half a mg."""

    def sizes(self, context: Context, variant: Variant) -> FloatArray:
        return thermal_sizes(context, variant, self.per_kelvin)

    def variants(self, context: Context) -> list[Variant]:
        return thermal_bias_variants(context, context.on_accelerometers, force_only, "m/s^2")


class GyroThermalBias(Thermal):
    """The same of the gyro."""

    id = "gyro-thermal-bias"
    leaves_open = ("gyro-zero",)
    drifts_as = "gyro-hidden-drift"
    per_kelvin = 4e-4
    """rad/s: 0.02 °/s."""

    def sizes(self, context: Context, variant: Variant) -> FloatArray:
        return thermal_sizes(context, variant, self.per_kelvin)

    def variants(self, context: Context) -> list[Variant]:
        return thermal_bias_variants(context, context.on_gyros, rate_only, "rad/s")
