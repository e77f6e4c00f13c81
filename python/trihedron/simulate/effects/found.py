"""Sizes of effects from the parameters that a diagnosis found, by effect and variant of its model."""

import math
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from trihedron.arrays import AXES

Parameters = Mapping[str, float]
Size = dict[str, Any]
Found: TypeAlias = Callable[[Parameters, str], Size | list[Size]]


class NotSimulatedError(Exception):
    """An accepted effect cannot be simulated; the message says why."""


LENGTH = "length of the session"
"""Key, beside an effect's parameters, of the time over which a linear drift lasts, s."""


def axes(**symbols: str) -> Found:
    """Sizes of the three axes by the diagnosis' symbols."""
    return lambda values, _variant: {name: _axis(values, symbol) for name, symbol in symbols.items()}


def number(name: str, symbol: str) -> Found:
    """One size by the diagnosis' name of it."""
    return lambda values, _variant: {name: values[symbol]}


def one_sigma(values: Parameters, _variant: str) -> Size:
    return {"sigma": (values["sigma"],) * 3}


def earth_rate(values: Parameters, _variant: str) -> Size:
    return {"latitude_deg": values["latitude"], "heading_deg": 0.0}


def nothing(_values: Parameters, _variant: str) -> Size:
    raise NotSimulatedError("it belongs to that session or its report, not to an instrument that can be simulated")


def _axis(values: Parameters, symbol: str) -> tuple[float, float, float]:
    x, y, z = (values.get(f"{symbol}_{axis}", 0.0) for axis in AXES)
    return (x, y, z)


def hysteresis(values: Parameters, variant: str) -> Size:
    if variant == "creep":
        return {"creep_fraction": _axis(values, "creep"), "creep_tau_s": values["time_constant"]}
    return {"offset_m_s2": _axis(values, "offset"), "width_m_s2": values["half_width"]}


def drift(values: Parameters, variant: str) -> Size:
    if variant == "line":
        if LENGTH not in values:
            raise NotSimulatedError(
                "a straight drift needs the length of its session, which the diagnosis does not say"
            )
        return {"change": _axis(values, "drift"), "length_s": values[LENGTH]}
    if variant != "warm-up":
        raise NotSimulatedError("a slow curve of any shape belongs to that session")
    return {"amplitude": _axis(values, "warm_up"), "tau_s": values["time_constant"]}


thermal_bias = axes(per_k="bias_per_kelvin", per_k2="bias_per_kelvin2")
thermal_scale = axes(per_k="scale_per_kelvin")


def g_sensitivity(values: Parameters, _variant: str) -> Size:
    return {"matrix": tuple(tuple(values.get(f"G_{i}{j}", 0.0) for j in AXES) for i in AXES)}


def limit(values: Parameters, _variant: str) -> Size:
    limits = []
    for axis in AXES:
        seen = [abs(values[f"limit_{axis}{sign}"]) for sign in "+-" if f"limit_{axis}{sign}" in values]
        limits.append(min(seen) if seen else math.inf)
    return {"limit": tuple(limits)}


def places(values: Parameters, _variant: str) -> Size:
    rows = [tuple(values.get(f"r{j}{axis}-r1{axis}", 0.0) for axis in AXES) for j in (2, 3)]
    return {"places_m": ((0.0, 0.0, 0.0), *rows)}


def lag(values: Parameters, _variant: str) -> Size:
    sensor = "accelerometer" if any(name.startswith("accelerometer") for name in values) else "gyroscope"
    symbol = "accelerometer_lag" if sensor == "accelerometer" else "gyro_lag"
    lag = (values[symbol],) * 3 if symbol in values else _axis(values, symbol)
    if min(lag) < 0.0:
        raise NotSimulatedError("its lag is negative: the other sensor lags")
    return {"sensor": sensor, "lag_s": lag}


def losses(values: Parameters, _variant: str) -> Size:
    losses = [
        (float(name[len("lost_at_") : -1]), round(value))
        for name, value in values.items()
        if name.startswith("lost_at_") and round(value) > 0
    ]
    if not losses:
        raise NotSimulatedError("no place of a loss is stated")
    return {"losses": losses}


def interference(values: Parameters, _variant: str) -> list[Size]:
    out: list[Size] = []
    for sensor, letter in (("accelerometer", "a"), ("gyroscope", "g")):
        amplitude = tuple(values.get(f"amplitude_{letter}{axis}", 0.0) for axis in AXES)
        if any(amplitude):
            out.append({"sensor": sensor, "frequency_hz": values["frequency"], "amplitude": amplitude})
    return out


def rectification(values: Parameters, variant: str) -> Size:
    if variant == "gyro":
        return {"sensor": "gyroscope", "coefficient": _axis(values, "gyro_bias_per_power")}
    return {"sensor": "accelerometer", "coefficient": _axis(values, "accel_bias_per_power")}
