"""Sizes of effects as triples and matrices, and the electronics that several effects change."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal, TypeAlias

from trihedron.errors import InputError
from trihedron.simulate.accelerometer import ProofMass
from trihedron.simulate.readout import NONE, Triple, triple
from trihedron.simulate.scenario import Scenario

Sensor: TypeAlias = Literal["accelerometer", "gyroscope"]
Change: TypeAlias = Callable[..., Scenario]


def electronics(scenario: Scenario, sensor: Sensor, **changes: Any) -> Scenario:
    part = getattr(scenario, checked(sensor))
    return replace(scenario, **{sensor: replace(part, electronics=replace(part.electronics, **changes))})


def checked(sensor: str) -> str:
    if sensor not in ("accelerometer", "gyroscope"):
        raise InputError(f"sensor is 'accelerometer' or 'gyroscope', got {sensor!r}")
    return sensor


# Parameters of suspension and bridge from the second and third order of a response (docs/simulation.md, eq. 3).


# A suspension (s2, s3) with deflection d per unit input, read through the bridge, has the input-referred output
# a + K2 a² + K3 a³ + ... with K2 = -s2 d and K3 = d² (1/4 - s3 + 2 s2²).
def suspension(deflection: float, k2: float, k3: float) -> tuple[float, float]:
    second = -k2 / deflection
    return second, 0.25 + 2.0 * second**2 - k3 / deflection**2


def response(deflection: float, second: float, third: float) -> tuple[float, float]:
    return -second * deflection, deflection**2 * (0.25 - third + 2.0 * second**2)


def with_response(mass: ProofMass, k2: Triple, k3: Triple) -> ProofMass:
    gap, second, third = list(mass.gap_m), [0.0] * 3, [0.0] * 3
    for k in range(3):
        omega2 = (2.0 * math.pi * mass.resonance_hz[k]) ** 2
        if k2[k] == 0.0 and k3[k] > 0.0:
            # The bridge alone makes the cubic: the gap is chosen so that ξ = d a with d²/4 = K3.
            gap[k] = 1.0 / (omega2 * 2.0 * math.sqrt(k3[k]))
        else:
            second[k], third[k] = suspension(1.0 / (omega2 * gap[k]), k2[k], k3[k])
    return replace(mass, gap_m=triple(gap), second=triple(second), third=triple(third), reads_bridge=True)


def mass_response(mass: ProofMass) -> tuple[Triple, Triple]:
    if not mass.reads_bridge:
        return NONE, NONE
    pairs = [response(float(mass.deflection[k]), mass.second[k], mass.third[k]) for k in range(3)]
    return triple([p[0] for p in pairs]), triple([p[1] for p in pairs])
