"""Effects that a diagnosis accepted, added to a simulation: ids and parameters become sizes of mechanisms."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from trihedron.arrays import AXES
from trihedron.simulate.effects import with_effect
from trihedron.simulate.scenario import Scenario

Parameters = Mapping[str, float]
Size = dict[str, Any]


class _NotSimulated(Exception):
    """An accepted effect cannot be simulated; the message says why."""


def with_diagnosed_effects(
    scenario: Scenario, effects: Sequence[Mapping[str, Any]]
) -> tuple[Scenario, tuple[str, ...], dict[str, str]]:
    """The scenario with the accepted effects of a diagnosis (``effects`` of its JSON).

    Returns the scenario, the ids of the effects added, and the reason of exclusion for every other id.
    """
    sizes, left_out = diagnosed_sizes(effects)
    done: list[str] = []
    for effect_id, size in sizes:
        scenario = with_effect(scenario, effect_id, **size)
        done.append(effect_id)
    return scenario, tuple(dict.fromkeys(done)), left_out


LENGTH = "length of the session"
"""Key, beside an effect's parameters, of the time over which a linear drift lasts, s."""


def diagnosed_sizes(
    effects: Sequence[Mapping[str, Any]], length_s: float | None = None
) -> tuple[list[tuple[str, Size]], dict[str, str]]:
    """Accepted effects as ids and sizes of mechanisms (keys of :func:`with_effect`), and why others are excluded.

    ``length_s`` is the duration of the recording in which the effects were found.
    """
    out: list[tuple[str, Size]] = []
    left_out: dict[str, str] = {}
    for effect in effects:
        effect_id = str(effect["id"])
        values = {str(p["name"]): float(p["value"]) for p in effect["parameters"] if p["value"] is not None}
        if length_s is not None:
            values[LENGTH] = length_s
        variant = str(effect.get("model", {}).get("variant", ""))
        try:
            out += [(effect_id, size) for size in _sizes(effect_id, values, variant)]
        except _NotSimulated as why:
            left_out[effect_id] = str(why)
    return out, left_out


def _sizes(effect_id: str, values: Parameters, variant: str) -> list[Size]:
    if effect_id not in _SIZES:
        raise _NotSimulated("it belongs to that session or its report, not to an instrument that can be simulated")
    size = _SIZES[effect_id](values, variant)
    return size if isinstance(size, list) else [size]


def _axis(values: Parameters, symbol: str, separator: str = "_") -> tuple[float, float, float]:
    x, y, z = (values.get(f"{symbol}{separator}{axis}", 0.0) for axis in AXES)
    return (x, y, z)


def _hysteresis(values: Parameters, variant: str) -> Size:
    if variant == "creep":
        return {"creep_fraction": _axis(values, "creep"), "creep_tau_s": values["time_constant"]}
    return {"offset_m_s2": _axis(values, "offset"), "width_m_s2": values["half_width"]}


def _drift(values: Parameters, variant: str) -> Size:
    if variant == "line":
        if LENGTH not in values:
            raise _NotSimulated("a straight drift needs the length of its session, which the diagnosis does not say")
        return {"change": _axis(values, "drift"), "length_s": values[LENGTH]}
    if variant != "warm-up":
        raise _NotSimulated("a slow curve of any shape belongs to that session")
    return {"amplitude": _axis(values, "warm_up"), "tau_s": values["time_constant"]}


def _thermal(symbol: str) -> Callable[[Parameters, str], Size]:
    def size(values: Parameters, _variant: str) -> Size:
        out: Size = {"per_k": _axis(values, f"{symbol}_per_kelvin")}
        if symbol == "bias":
            out["per_k2"] = _axis(values, "bias_per_kelvin2")
        return out

    return size


def _g_sensitivity(values: Parameters, _variant: str) -> Size:
    return {"matrix": tuple(tuple(values.get(f"G_{i}{j}", 0.0) for j in AXES) for i in AXES)}


def _limit(values: Parameters, _variant: str) -> Size:
    limits = []
    for axis in AXES:
        seen = [abs(values[f"limit_{axis}{sign}"]) for sign in "+-" if f"limit_{axis}{sign}" in values]
        limits.append(min(seen) if seen else math.inf)
    return {"limit": tuple(limits)}


def _places(values: Parameters, _variant: str) -> Size:
    rows = [tuple(values.get(f"r{j}{axis}-r1{axis}", 0.0) for axis in AXES) for j in (2, 3)]
    return {"places_m": ((0.0, 0.0, 0.0), *rows)}


def _lag(values: Parameters, _variant: str) -> Size:
    sensor = "accelerometer" if any(name.startswith("accelerometer") for name in values) else "gyroscope"
    symbol = "accelerometer_lag" if sensor == "accelerometer" else "gyro_lag"
    lag = (values[symbol],) * 3 if symbol in values else _axis(values, symbol)
    if min(lag) < 0.0:
        raise _NotSimulated("its lag is negative: the other sensor lags")
    return {"sensor": sensor, "lag_s": lag}


def _losses(values: Parameters, _variant: str) -> Size:
    losses = [
        (float(name[len("lost_at_") : -1]), round(value))
        for name, value in values.items()
        if name.startswith("lost_at_") and round(value) > 0
    ]
    if not losses:
        raise _NotSimulated("no place of a loss is stated")
    return {"losses": losses}


def _interference(values: Parameters, _variant: str) -> list[Size]:
    out: list[Size] = []
    for sensor, letter in (("accelerometer", "a"), ("gyroscope", "g")):
        amplitude = tuple(values.get(f"amplitude_{letter}{axis}", 0.0) for axis in AXES)
        if any(amplitude):
            out.append({"sensor": sensor, "frequency_hz": values["frequency"], "amplitude": amplitude})
    return out


def _rectification(values: Parameters, variant: str) -> Size:
    if variant == "gyro":
        return {"sensor": "gyroscope", "coefficient": _axis(values, "gyro_bias_per_power")}
    return {"sensor": "accelerometer", "coefficient": _axis(values, "accel_bias_per_power")}


_SIZES: dict[str, Callable[[Parameters, str], Size | list[Size]]] = {
    "accel-quadratic": lambda v, _: {"k2": _axis(v, "K2")},
    "accel-cubic": lambda v, _: {"k3": _axis(v, "K3")},
    "accel-scale-asymmetry": lambda v, _: {"asymmetry": _axis(v, "half_difference")},
    "accel-hysteresis": _hysteresis,
    "accel-thermal-bias": _thermal("bias"),
    "accel-thermal-scale": _thermal("scale"),
    "gyro-thermal-bias": _thermal("bias"),
    "gyro-thermal-scale": _thermal("scale"),
    "accel-bias-drift": _drift,
    "gyro-bias-drift": _drift,
    "accel-bias-repeatability": lambda v, _: {"sigma": (v["sigma"],) * 3},
    "gyro-bias-repeatability": lambda v, _: {"sigma": _axis(v, "sigma")},
    "gyro-g-sensitivity": _g_sensitivity,
    "gyro-scale-nonlinearity": lambda v, _: {"c2": _axis(v, "quadratic"), "c3": _axis(v, "cubic")},
    "gyro-saturation": _limit,
    "accel-saturation": _limit,
    "lever-arm": lambda v, _: {"arm_m": _axis(v, "r")},
    "accel-size-effect": _places,
    # The gyro sampling later under the same timestamp is equivalent to the accelerometer being delayed.
    "accel-gyro-time-offset": lambda v, _: {"offset_s": v["accelerometer_delay"]},
    "sensor-lag": _lag,
    "dropped-samples": _losses,
    "timing-jitter": lambda v, _: {"jitter_s": v["jitter"]},
    "periodic-interference": _interference,
    "vibration-rectification": _rectification,
    "earth-rate": lambda v, _: {"latitude_deg": v["latitude"], "heading_deg": 0.0},
}
