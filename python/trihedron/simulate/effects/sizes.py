"""Sizes of effects as triples and matrices, and the electronics that several effects change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal, TypeAlias

from trihedron.errors import RefusedError
from trihedron.simulate.readout import Matrix, Triple
from trihedron.simulate.scenario import Scenario

Sensor: TypeAlias = Literal["accelerometer", "gyroscope"]
Change: TypeAlias = Callable[..., Scenario]
Values: TypeAlias = float | Sequence[float]


def triple(value: Values) -> Triple:
    if isinstance(value, (int, float)):
        return (float(value), float(value), float(value))
    if len(value) != 3:
        raise RefusedError(f"three numbers, one per axis, are wanted, got {list(value)}")
    return (float(value[0]), float(value[1]), float(value[2]))


def matrix3(rows: Sequence[Values]) -> Matrix:
    if len(rows) != 3:
        raise RefusedError(f"three rows are wanted, got {len(rows)}")
    return (triple(rows[0]), triple(rows[1]), triple(rows[2]))


def electronics(scenario: Scenario, sensor: Sensor, **changes: Any) -> Scenario:
    part = getattr(scenario, checked(sensor))
    return replace(scenario, **{sensor: replace(part, electronics=replace(part.electronics, **changes))})


def checked(sensor: str) -> str:
    if sensor not in ("accelerometer", "gyroscope"):
        raise RefusedError(f"sensor is 'accelerometer' or 'gyroscope', got {sensor!r}")
    return sensor
