"""Readings in physical units that step like counts: the step is the converter's, and worth saying."""

from __future__ import annotations

import math

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.read.audit.clipping import AXES, quantum, short
from trihedron.records import Finding, FindingCode
from trihedron.units import (
    STANDARD_GRAVITY_M_S2,
    AccelerationUnit,
    RateUnit,
    acceleration_to_si,
    degrees_from_radians,
    rate_to_si,
)

_OFF_LATTICE = 0.05
_MIN_ON_LATTICE = 0.95


def audit_steps(sensor: str, readings: FloatArray, unit: AccelerationUnit | RateUnit) -> list[Finding]:
    """A note on the step of a triad (n, 3) whose unit is not counts; nothing where readings take any value."""
    if unit.value == "counts":
        return []
    steps = [_lattice(readings[:, k]) for k in range(3)]
    if not all(steps):
        return []
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


def _lattice(values: FloatArray) -> float:
    """The step of one axis where nearly all its readings are whole numbers of it apart; else 0."""
    probe = values[:: max(1, len(values) // 100_000)]
    probe = probe[np.isfinite(probe)]
    if len(probe) < 8:
        return 0.0
    step = quantum(probe)
    if step <= 0.0:
        return 0.0
    place = (probe - probe[0]) / step
    # The smallest steps seen carry the rounding of the text; the whole range tells the step to many more digits.
    whole = np.rint(place)
    if np.ptp(whole) > 0:
        step *= float(np.sum(place * whole) / np.sum(whole * whole))
        place = (probe - probe[0]) / step
    on = np.abs(place - np.rint(place)) < _OFF_LATTICE
    return float(step) if np.mean(on) >= _MIN_ON_LATTICE else 0.0


def _is_decimal(step: float) -> bool:
    exponent = math.log10(step)
    return abs(exponent - round(exponent)) < 1e-4


def _per_unit(step_si: float, sensor: str) -> float:
    """Steps in one g, or in one degree per second."""
    if sensor == "accelerometer":
        return STANDARD_GRAVITY_M_S2 / step_si
    return 1.0 / degrees_from_radians(step_si)
