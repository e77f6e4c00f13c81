"""A scenario: who moves what instrument where, sampled how."""

from __future__ import annotations

from dataclasses import dataclass, field

from trihedron.simulate.motion import Motion
from trihedron.simulate.sensors import Accelerometer, Gyroscope
from trihedron.units import STANDARD_GRAVITY_M_S2


@dataclass(frozen=True)
class Environment:
    """Where it happens."""

    gravity_m_s2: float = STANDARD_GRAVITY_M_S2


@dataclass(frozen=True)
class Clock:
    """When samples are taken."""

    rate_hz: float = 100.0

    def __post_init__(self) -> None:
        if not 0.0 < self.rate_hz < 1e6:
            raise ValueError(f"rate_hz must be a positive number, got {self.rate_hz}")


@dataclass(frozen=True)
class Scenario:
    """Everything that decides a simulated recording, apart from the seed."""

    motion: Motion
    name: str = "scenario"
    accelerometer: Accelerometer = field(default_factory=Accelerometer)
    gyroscope: Gyroscope = field(default_factory=Gyroscope)
    clock: Clock = field(default_factory=Clock)
    environment: Environment = field(default_factory=Environment)
