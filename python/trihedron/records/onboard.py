"""Corrections that a flight controller applies to its readings before it logs them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

Autopilot = Literal["ardupilot", "px4"]
Stage = Literal["raw", "corrected", "body"]


@dataclass(frozen=True)
class Onboard:
    """The sensor parameters of the controller while the log was made, as the log states them.

    ``accel`` and ``gyro`` are the indices of the sensors in the names of the parameters, from 0. ``stage`` is the
    processing of the logged readings: ``raw`` (none), ``corrected`` (offset and scale, in the sensor's axes),
    ``body`` (the same, then rotated into the axes of the board). ``changed`` names parameters that changed while
    readings were logged.
    """

    autopilot: Autopilot
    accel: int
    gyro: int
    stage: Stage
    parameters: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    changed: tuple[str, ...] = ()
