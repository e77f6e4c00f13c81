"""The sealed truth in the names, units and sign conventions in which the diagnosis states its parameters.

Where the definition of an effect leaves a choice (what its zero is counted from, which of two axes is meant), the
truth is carried to the diagnosis's choice here, once, from documented definitions (docs/diagnosis-method.md).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron.records import Recording
from trihedron.records.truth import Truth
from trihedron.simulate import Scenario

AXES = "xyz"
Sealed = dict[str, float]
FloatArray = npt.NDArray[np.float64]


def sealed_parameters(effect: str, size: dict[str, Any], scenario: Scenario, log: Recording, truth: Truth) -> Sealed:
    """Name → true value of every parameter that has one; empty where the answer is a place or a sign."""
    made = _PARAMETERS.get(effect)
    return {} if made is None else made(size, scenario, log, truth)


def per_axis(symbol: str, values: Any) -> Sealed:
    three = np.broadcast_to(np.asarray(values, dtype=float), 3)
    return {f"{symbol}_{axis}": float(v) for axis, v in zip(AXES, three, strict=True)}


def pose_mean(values: FloatArray, truth: Truth) -> float:
    """Mean over the poses of the mean of each: what the diagnosis counts logged channels from."""
    poses = [part for part in truth.segments if part.kind == "pose" and part.stop > part.start]
    return float(np.mean([values[p.start : p.stop].mean() for p in poses]))


def _thermal_bias(size: dict[str, Any], _s: Scenario, _r: Recording, _t: Truth) -> Sealed:
    return per_axis("bias_per_kelvin", size["per_k"])


def _thermal_scale(size: dict[str, Any], scenario: Scenario, log: Recording, truth: Truth) -> Sealed:
    # f (1 + k t) = f (1 + k t0) (1 + k' (t - t0)): counted from the mean temperature t0, k' = k / (1 + k t0).
    assert log.temperature_degc is not None
    t0 = pose_mean(log.temperature_degc, truth) - scenario.environment.temperature.reference_degc
    k = np.asarray(size["per_k"])
    return per_axis("scale_per_kelvin", k / (1.0 + k * t0))


def _supply(size: dict[str, Any], scenario: Scenario, log: Recording, truth: Truth) -> Sealed:
    # raw (1 + r (v/v_n - 1)), counted from the mean voltage; the offset of the raw reading is scaled as well.
    assert log.supply_v is not None
    relative = pose_mean(log.supply_v, truth) / scenario.environment.supply.nominal_v
    r = size["ratiometric"]
    k = r * relative / (1.0 + r * (relative - 1.0))
    accel = scenario.accelerometer
    inverse = np.linalg.inv(np.asarray(accel.S))
    offset = -(inverse @ np.asarray(accel.b)) / np.linalg.norm(inverse, axis=1)
    return per_axis("accel_scale", k) | per_axis("accel_offset", k * offset)


def _g_sensitivity(size: dict[str, Any], scenario: Scenario, _r: Recording, _t: Truth) -> Sealed:
    # The instrument's rows are channels, the diagnosis's are axes of the case: channels carried over by their axes.
    S = np.asarray(scenario.gyroscope.S)
    G = S * np.linalg.norm(np.linalg.inv(S), axis=1) @ np.asarray(size["matrix"])
    return {f"G_{AXES[i]}{AXES[j]}": float(G[i, j]) for i in range(3) for j in range(3)}


def _nonlinearity(size: dict[str, Any], _s: Scenario, _r: Recording, _t: Truth) -> Sealed:
    return per_axis("cubic", size.get("c3", 0.0)) | per_axis("quadratic", size.get("c2", 0.0))


def _limit(size: dict[str, Any], _s: Scenario, _r: Recording, _t: Truth) -> Sealed:
    return {f"limit_{axis}{sign}": float(size["limit"]) * (1 if sign == "+" else -1) for axis in AXES for sign in "+-"}


def _places(size: dict[str, Any], _s: Scenario, _r: Recording, _t: Truth) -> Sealed:
    p = np.asarray(size["places_m"])
    return {f"r{j + 1}{axis}-r1{axis}": float(p[j, c] - p[0, c]) for j in (1, 2) for c, axis in enumerate(AXES)}


def _lag(size: dict[str, Any], _s: Scenario, _r: Recording, _t: Truth) -> Sealed:
    name = "accelerometer_lag" if size["sensor"] == "accelerometer" else "gyro_lag"
    return {name: float(size["lag_s"][0])} | per_axis(name, size["lag_s"])


def _losses(_size: dict[str, Any], _s: Scenario, log: Recording, truth: Truth) -> Sealed:
    # Where the log's rows jump, by the log's own timestamps: those have closed over the gaps.
    gaps = np.diff(truth.kept) - 1
    at = np.flatnonzero(gaps > 0)
    named = {f"lost_at_{log.time_s[k]:.2f}s": float(gaps[k]) for k in at}
    return {"events": float(len(at)), "samples_lost": float(gaps.sum())} | named


def _earth(size: dict[str, Any], _s: Scenario, _r: Recording, _t: Truth) -> Sealed:
    return {"rate": 7.292115e-5, "latitude": size["latitude_deg"]}


def _rectification(size: dict[str, Any], scenario: Scenario, _r: Recording, _t: Truth) -> Sealed:
    # The instrument rectifies what is faster than its corner fc; the diagnosis counts the whole power of the reading.
    # Of a flat band from f1 to f2 a first-order high-pass leaves 1 - fc/(f2-f1) (atan(f2/fc) - atan(f1/fc)).
    sensor = size["sensor"]
    fc, f1, f2 = getattr(scenario, sensor).rectification_corner_hz, 20.0, 40.0
    share = 1.0 - fc / (f2 - f1) * (np.arctan(f2 / fc) - np.arctan(f1 / fc))
    name = "gyro_bias_per_power" if sensor == "gyroscope" else "accel_bias_per_power"
    return per_axis(name, share * np.asarray(size["coefficient"]))


def _interference(size: dict[str, Any], _s: Scenario, _r: Recording, _t: Truth) -> Sealed:
    letter = size["sensor"][0]
    return {"frequency": size["frequency_hz"]} | {f"amplitude_{letter}{axis}": size["amplitude"] for axis in AXES}


def _jitter(_size: dict[str, Any], _s: Scenario, _r: Recording, truth: Truth) -> Sealed:
    # What the instants truly scatter by: the simulator keeps neighbours from overtaking, which cuts the tails.
    assert truth.kept is not None
    line = np.polynomial.Polynomial.fit(truth.kept, truth.accelerometer_time_s, 1)
    return {"jitter": float(np.std(truth.accelerometer_time_s - line(truth.kept)))}


def _steps(size: dict[str, Any], scenario: Scenario, _r: Recording, _t: Truth) -> Sealed:
    gain = np.linalg.norm(np.linalg.inv(np.asarray(scenario.accelerometer.S)), axis=1)
    return {f"lsb_a{axis}": float(size["lsb"] / gain[c]) for c, axis in enumerate(AXES)}


_PARAMETERS: dict[str, Callable[[dict[str, Any], Scenario, Recording, Truth], Sealed]] = {
    "accel-quadratic": lambda size, *_: per_axis("K2", size["k2"]),
    "accel-cubic": lambda size, *_: per_axis("K3", size["k3"]),
    "accel-scale-asymmetry": lambda size, *_: per_axis("half_difference", size["asymmetry"]),
    "accel-hysteresis": lambda size, *_: (
        per_axis("offset", size["offset_m_s2"]) | {"half_width": float(size["width_m_s2"])}
    ),
    "accel-thermal-bias": _thermal_bias,
    "gyro-thermal-bias": _thermal_bias,
    "accel-thermal-scale": _thermal_scale,
    "gyro-thermal-scale": _thermal_scale,
    "accel-bias-drift": lambda size, *_: (
        per_axis("warm_up", size["amplitude"]) | {"time_constant": float(size["tau_s"])}
    ),
    "gyro-bias-drift": lambda size, *_: (
        per_axis("warm_up", size["amplitude"]) | {"time_constant": float(size["tau_s"])}
    ),
    "gyro-g-sensitivity": _g_sensitivity,
    "gyro-scale-nonlinearity": _nonlinearity,
    "gyro-saturation": _limit,
    "accel-saturation": _limit,
    "accel-size-effect": _places,
    "lever-arm": lambda size, *_: per_axis("r", size["arm_m"]),
    "accel-gyro-time-offset": lambda size, *_: {"accelerometer_delay": size["offset_s"]},
    "sensor-lag": _lag,
    "dropped-samples": _losses,
    "timing-jitter": _jitter,
    "earth-rate": _earth,
    "vibration-rectification": _rectification,
    "periodic-interference": _interference,
    "quantisation": _steps,
    "supply-sensitivity": _supply,
    "table-tilt": lambda size, *_: {"tilt": float(np.hypot(*size["tilt_deg"]))},
}
"""Effects whose answer is a place, an index or a sign (disturbed pose, turns, handedness) are not listed."""
