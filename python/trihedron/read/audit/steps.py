"""Readings in physical units that step like counts: the step is the ADC's, and worth saying."""

from __future__ import annotations

import math

import numpy as np

from trihedron.arrays import AXES
from trihedron.channel_facts.quiet import Windows
from trihedron.read.audit.clipping import short
from trihedron.records import Finding, FindingCode
from trihedron.records.channel_facts import ChannelFacts
from trihedron.units import (
    STANDARD_GRAVITY_M_S2,
    AccelerationUnit,
    RateUnit,
    acceleration_to_si,
    degrees_from_radians,
    rate_to_si,
)

LOST_IN_NOISE = 0.01
"""Steps below this part of the noise are not worth saying: a hundred of them are one deviation of a reading."""


def audit_steps(
    sensor: str, facts: ChannelFacts, windows: Windows | None, unit: AccelerationUnit | RateUnit
) -> list[Finding]:
    """A note on the steps (3,) of readings whose unit is not counts; nothing where they are lost in the noise."""
    noise = np.zeros(3) if windows is None else windows.quiet_noise(sensor)
    if unit.value == "counts" or not np.all(facts.step > LOST_IN_NOISE * noise):
        return []
    steps = facts.step.tolist()
    scale = acceleration_to_si(unit) if isinstance(unit, AccelerationUnit) else rate_to_si(unit)
    usual = float(np.median(steps))
    return [
        Finding.of(
            FindingCode.RAW_STEP,
            sensor=short(sensor),
            unit=unit.value,
            steps=list(zip(AXES, steps, strict=True)),
            per_unit=_per_unit(usual * (scale or math.nan), sensor),
            is_accelerometer=sensor == "accelerometer",
            is_decimal=_is_decimal(usual),
            numbers={f"{axis}_step": step for axis, step in zip(AXES, steps, strict=True)},
        )
    ]


def _is_decimal(step: float) -> bool:
    exponent = math.log10(step)
    return abs(exponent - round(exponent)) < 1e-4


def _per_unit(step_si: float, sensor: str) -> float:
    """Steps in one g, or in one degree per second."""
    if sensor == "accelerometer":
        return STANDARD_GRAVITY_M_S2 / step_si
    return 1.0 / degrees_from_radians(step_si)
