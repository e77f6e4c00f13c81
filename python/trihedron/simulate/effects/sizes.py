"""Types of the modules of this folder, and sizes of effects from the parameters of a diagnosis."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Literal, TypeAlias

from trihedron.arrays import AXES
from trihedron.errors import InputError
from trihedron.simulate.readout import Triple
from trihedron.simulate.scenario import Scenario

Sensor: TypeAlias = Literal["accelerometer", "gyroscope"]
SENSORS: dict[Sensor, str] = {"accelerometer": "accel", "gyroscope": "gyro"}
"""Sensors, and what ids of effects call them."""
Change: TypeAlias = Callable[..., Scenario]
"""Adds an effect to a scenario; its parameters after the scenario are the effect's."""
Parameters: TypeAlias = Mapping[str, float]
Size: TypeAlias = dict[str, Any]
Found: TypeAlias = Callable[[Parameters, str], Size | list[Size]]
"""Parameters that a diagnosis found and the variant of its model → arguments of ``Change``."""
Effects: TypeAlias = dict[str, tuple[Change, Found]]
"""By id: how an effect is added to a scenario, and its size from the parameters of a diagnosis."""
Noted: TypeAlias = Iterator[tuple[str, dict[str, object]]]
"""Ids of effects that a scenario contains, and their physical parameters."""
LENGTH = "length of the session"
"""Key, beside an effect's parameters, of the time over which a linear drift lasts, s."""


class NotSimulatedError(Exception):
    """An accepted effect cannot be simulated; the message says why."""


def axes(**symbols: str) -> Found:
    """Sizes of the three axes by the diagnosis' symbols."""
    return lambda values, _variant: {name: along(values, symbol) for name, symbol in symbols.items()}


def number(name: str, symbol: str) -> Found:
    """One size by the diagnosis' name of it."""
    return lambda values, _variant: {name: values[symbol]}


def nothing(_values: Parameters, _variant: str) -> Size:
    raise NotSimulatedError("it belongs to that session or its report, not to an instrument that can be simulated")


def along(values: Parameters, symbol: str) -> Triple:
    x, y, z = (values.get(f"{symbol}_{axis}", 0.0) for axis in AXES)
    return (x, y, z)


def checked(sensor: str) -> str:
    if sensor not in SENSORS:
        raise InputError(f"sensor is 'accelerometer' or 'gyroscope', got {sensor!r}")
    return sensor
