"""Bias or scale of either sensor that depends on a logged temperature."""

from typing import ClassVar

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import ACCELEROMETER, GYRO, SENSORS, Effect, Variant, on_axes, per_axis
from trihedron.records.words import why_not
from trihedron.session.drift import LEAST_SWING_K, PER_KELVIN

LEAST_RATE_RANGE = 0.3
"""Range of the rate of temperature over its largest value, below which it is confounded with a constant."""
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
        distortion = on_axes(context, self.sensor, context.temperature[:, None] * context.axis_motion(self.sensor))
        return [Variant(distortion, per_axis("scale_per_kelvin"), ("1/K",) * 3)]


class AccelThermalScale(ThermalScale):
    id, sensor = "accel-thermal-scale", ACCELEROMETER
    confounded_with = ("accel-bias", "accel-scale")


class GyroThermalScale(ThermalScale):
    id, sensor = "gyro-thermal-scale", GYRO
    confounded_with = ("gyro-bias", "gyro-scale")


class ThermalBias(Thermal):
    """Bias over temperature, with its rate of change, or with another branch while it cools."""

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
        """Forward models, simplest first. Temperature is relative to its mean over the poses, its rate to 0."""
        assert context.temperature is not None
        t, speed, unit = context.temperature[:, None], context.temperature_rate, SENSORS[self.sensor].unit
        powers = [("bias_per_kelvin", t, f"{unit}/K"), ("bias_per_kelvin2", t**2, f"{unit}/K^2"),
                  ("bias_per_kelvin3", t**3, f"{unit}/K^3")]  # fmt: skip
        shapes = {"linear": powers[:1], "quadratic": powers[:2]}
        # Compensation of another log (no poses) needs the fitted shape, whatever that log's temperature does.
        is_fitted, beside = context.obs.n_poses > 0, {}
        varies = speed is not None and speed.any() and np.ptp(speed) >= LEAST_RATE_RANGE * np.abs(speed).max()
        if speed is not None and (not is_fitted or varies):
            beside["rate"] = [("bias_per_kelvin_per_s", speed[:, None], f"{unit}/(K/s)")]
            if not is_fitted or (speed.min() < -BRANCH_K_S and speed.max() > BRANCH_K_S):
                beside["hysteresis"] = [("half_gap", np.tanh(speed / BRANCH_K_S)[:, None], unit)]
        shapes |= {label: [*powers[:1], *more] for label, more in beside.items()}
        if not context.moves:
            # A log of a temperature cycle in one orientation shows more of the curve than S and b leave to a session.
            beside |= {"rate, hysteresis": [*beside["rate"], *beside["hysteresis"]]} if len(beside) > 1 else {}
            shapes |= {"cubic": powers}
            shapes |= {f"{name}, {label}": [*powers[:n], *more] for label, more in beside.items()
                       for name, n in (("quadratic", 2), ("cubic", 3))}  # fmt: skip
        return [
            Variant(
                on_axes(context, self.sensor, *(values for _, values, _ in parts)),
                tuple(name for symbol, *_ in parts for name in per_axis(symbol)),
                tuple(of for *_, of in parts for _ in AXES), label=label,
            )
            for label, parts in shapes.items()
        ]  # fmt: skip


class AccelThermalBias(ThermalBias):
    id, sensor = "accel-thermal-bias", ACCELEROMETER
    confounded_with = ("accel-bias",)


class GyroThermalBias(ThermalBias):
    id, sensor = "gyro-thermal-bias", GYRO
    confounded_with = ("gyro-bias",)
