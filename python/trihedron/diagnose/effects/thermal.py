"""Bias or scale of either sensor that depends on a logged temperature."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import LEAST_SWING_K, Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only, per_axis, rate_only
from trihedron.diagnose.effects.thermal_shapes import thermal_bias_variants, thermal_sizes
from trihedron.records.words import why_not


class Thermal(Effect):
    """Applies where a temperature was logged and changed."""

    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        if context.temperature is None:
            return why_not("no-temperature")
        if np.ptp(context.temperature) < LEAST_SWING_K:
            return why_not("steady-temperature", least_k=LEAST_SWING_K)
        return None


class ThermalScale(Thermal):
    """Relative scale linear in temperature (about its mean over the poses)."""

    size = 3e-4
    """1/K: 300 ppm."""
    is_gyro: ClassVar[bool] = False

    def variants(self, context: Context) -> list[Variant]:
        assert context.temperature is not None
        t = context.temperature[:, None]
        if self.is_gyro:
            distortion = rate_only(context.on_gyros(t * context.axis_rate))
        else:
            distortion = force_only(context.on_accelerometers(t * context.axis_force))
        return [Variant(distortion, per_axis("scale_per_kelvin"), ("1/K",) * 3)]


class AccelThermalScale(ThermalScale):
    """Accelerometer scale."""

    id = "accel-thermal-scale"
    confounded_with = ("accel-bias", "accel-scale")
    drifts_as = "accel-bias-drift"


class GyroThermalScale(ThermalScale):
    """Gyro scale."""

    id = "gyro-thermal-scale"
    is_gyro = True
    confounded_with = ("gyro-bias", "gyro-scale")
    drifts_as = "gyro-bias-drift"


class ThermalBias(Thermal):
    """Bias linear or quadratic in temperature; with its rate of change, or with another branch while it cools."""

    per_kelvin: ClassVar[float]
    """Typical bias change per kelvin, one sigma, SI."""
    is_gyro: ClassVar[bool] = False

    def sizes(self, context: Context, variant: Variant) -> FloatArray:
        return thermal_sizes(context, variant, self.per_kelvin)

    def variants(self, context: Context) -> list[Variant]:
        if self.is_gyro:
            return thermal_bias_variants(context, context.on_gyros, rate_only, "rad/s")
        return thermal_bias_variants(context, context.on_accelerometers, force_only, "m/s^2")


class AccelThermalBias(ThermalBias):
    """Accelerometer bias: half a mg per kelvin."""

    id = "accel-thermal-bias"
    confounded_with = ("accel-bias",)
    drifts_as = "accel-bias-drift"
    per_kelvin = 0.005


class GyroThermalBias(ThermalBias):
    """Gyro bias: 0.02 °/s per kelvin."""

    id = "gyro-thermal-bias"
    is_gyro = True
    confounded_with = ("gyro-bias",)
    drifts_as = "gyro-bias-drift"
    per_kelvin = 4e-4
