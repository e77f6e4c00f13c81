"""Why a recording cannot show an effect: the words of a candidate that was not tried, by id."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

REASONS: Mapping[str, str] = MappingProxyType(
    {
        "no-gyro": "the log has no gyro",
        "no-moves": "the log has no moves with a gyro",
        "six-moves": "fewer than six moves with a gyro",
        "no-temperature": "the log has no temperature",
        "steady-temperature": "the temperature changes by less than {least_k:g} °C",
        "no-supply": "the log has no supply voltage",
        "steady-supply": "the supply voltage does not change",
        "even-vibration": "no pose vibrates more than the others",
        "no-table-turns": "the session has no turns on a table against a wall",
        "six-poses": "fewer than six poses",
        "few-orientations": "the log has too few orientations",
    }
)
