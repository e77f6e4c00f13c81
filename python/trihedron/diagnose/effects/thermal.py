"""Bias or scale of either sensor that depends on a logged temperature or supply voltage."""

from typing import ClassVar

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import ACCELEROMETER, GYRO, SENSORS, Effect, Variant, on_axes
from trihedron.diagnose.session.solve import stacked
from trihedron.records.words import why_not
from trihedron.session.drift import LEAST_SWING_K, PER_KELVIN, SLOW_S

CURVES = ("linear", "quadratic", "cubic")
LAG, RATE, HYSTERESIS = "lag", "rate", "hysteresis"
BRANCH_K_S = 0.002
"""Rate of change at which a branch reaches three quarters: an oven has ten times as much, a room a tenth."""


class Thermal(Effect):
    """Applies where a temperature was logged and changed."""

    applies_elsewhere = True
    sensor: ClassVar[int]

    def unavailable(self, context: Context) -> str | None:
        if context.temperature is None:
            return why_not("no-temperature")
        is_steady = np.ptp(context.temperature) < LEAST_SWING_K
        return why_not("steady-temperature", least_k=LEAST_SWING_K) if is_steady else None


class ThermalScale(Thermal):
    """Relative scale linear in temperature (about its mean over the poses)."""

    size = 3e-4
    """1/K: 300 ppm."""

    def variants(self, context: Context) -> list[Variant]:
        assert context.temperature is not None
        per_kelvin = context.temperature[:, None] * context.axis_motion(self.sensor)
        return [on_axes(context, self.sensor, ("scale_per_kelvin", per_kelvin, "1/K"))]


class AccelThermalScale(ThermalScale):
    id, sensor = "accel-thermal-scale", ACCELEROMETER
    confounded_with = ("accel-bias", "accel-scale")


class GyroThermalScale(ThermalScale):
    id, sensor = "gyro-thermal-scale", GYRO
    confounded_with = ("gyro-bias", "gyro-scale")


class ThermalBias(Thermal):
    """Bias over the temperature of the die, from which the thermometer may lag, or with another branch while it
    cools."""

    def sizes(self, context: Context, variant: Variant) -> FloatArray:
        """Quadratic, rate and hysteresis terms change the bias by a third of what the linear term does."""
        assert context.temperature is not None
        swing, per_kelvin = float(np.ptp(context.temperature)), PER_KELVIN[self.sensor]
        beside = per_kelvin * swing / 3.0
        by_name = {"bias_per_kelvin": per_kelvin, "half_gap": beside}
        by_name |= {f"bias_per_kelvin{k}": beside / swing**k for k in (2, 3)}
        if context.temperature_rate is not None:
            by_name["bias_per_kelvin_per_s"] = beside / max(float(np.abs(context.temperature_rate).max()), BRANCH_K_S)
        return np.array([by_name[name.rsplit("_", 1)[0]] for name in variant.names])

    def variants(self, context: Context) -> list[Variant]:
        """Forward models, simplest first."""
        assert context.temperature_rate is not None
        slowest, fastest = context.temperature_rate.min(), context.temperature_rate.max()
        # Compensation of another log (no poses) needs the fitted shape, whatever that log's temperature does.
        is_cycle = context.obs.n_poses == 0 or (slowest < -BRANCH_K_S and fastest > BRANCH_K_S)
        # A log of a temperature cycle in one orientation shows more of the curve than S and b leave to a session.
        curves, bent = (CURVES[:2], CURVES[:1]) if context.moves else (CURVES, CURVES)
        out = [self._over_temperature(context, curve) for curve in curves]
        out += [self._over_temperature(context, f"{curve}, {HYSTERESIS}") for curve in bent if is_cycle]
        # Gradients across the part follow the rate, on each axis by a factor of its own.
        out += [self._over_temperature(context, f"{curve}, {RATE}") for curve in bent]
        lags = [sign * lag_s for sign in (1.0, -1.0) for lag_s in SLOW_S]
        return out + [self._over_temperature(context, f"{curve}, {LAG}", one) for curve in bent for one in lags]

    def reshaped(self, context: Context, variant: Variant, value: float) -> Variant | None:
        return self._over_temperature(context, variant.label, value) if variant.shape else None

    def _over_temperature(self, context: Context, label: str, lag_s: float = 0.0) -> Variant:
        """Temperature is relative to the mean of the logged one over the poses."""
        assert context.temperature_rate is not None
        curve, _, beside = label.partition(", ")
        t, rate = context.die_temperature(lag_s)[:, None], context.temperature_rate[:, None]
        unit = SENSORS[self.sensor].unit
        powers = [("bias_per_kelvin", t, f"{unit}/K"), ("bias_per_kelvin2", t**2, f"{unit}/K^2"),
                  ("bias_per_kelvin3", t**3, f"{unit}/K^3")]  # fmt: skip
        parts = powers[: 1 + CURVES.index(curve)]
        if beside == RATE:
            parts.append(("bias_per_kelvin_per_s", rate, f"{unit}/(K/s)"))
        elif beside == HYSTERESIS:
            parts.append(("half_gap", np.tanh(rate / BRANCH_K_S), unit))
        shape = {"thermometer_lag": (lag_s, "s")} if beside == LAG else {}
        return on_axes(context, self.sensor, *parts, label=label, shape=shape)


class AccelThermalBias(ThermalBias):
    id, sensor = "accel-thermal-bias", ACCELEROMETER
    confounded_with = ("accel-bias",)


class GyroThermalBias(ThermalBias):
    id, sensor = "gyro-thermal-bias", GYRO
    confounded_with = ("gyro-bias",)


class SupplySensitivity(Effect):
    """Ratiometric readout: scale and offset proportional to the logged supply voltage."""

    id = "supply-sensitivity"
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        if context.supply is None:
            return why_not("no-supply")
        return None if np.ptp(context.supply) > 0.0 else why_not("steady-supply")

    def variants(self, context: Context) -> list[Variant]:
        assert context.supply is not None
        v = context.supply[:, None]
        out = [
            on_axes(context, sensor, (f"{prefix}_scale", v * context.axis_motion(sensor), "1"),
                    (f"{prefix}_offset", v, unit), label=label)
            for sensor, (label, prefix, _, unit, _) in enumerate(SENSORS)
            if sensor == ACCELEROMETER or context.obs.raw_rate is not None
        ]  # fmt: skip
        if len(out) == 1:
            return out
        # Both sensors of a chip have one supply.
        accel, gyro = out
        both = stacked([accel.distortion, gyro.distortion])
        return [accel, gyro, Variant(both, accel.names + gyro.names, accel.units + gyro.units, label="both")]
