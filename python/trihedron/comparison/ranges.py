"""Ranges that a scenario states, beside those that a recording ends at."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from trihedron.arrays import AXES
from trihedron.diagnose.against.mechanisms import CODE, FRAME_TOLERANCE
from trihedron.records import Recording
from trihedron.records.diagnosis import AcceptedEffect
from trihedron.sensor_model import correct
from trihedron.simulate import Scenario

SENSOR = {"accel-saturation": "accelerometer", "gyro-saturation": "gyroscope"}
"""Whose range an effect is the end of."""


def stated_ranges(
    scenario: Scenario, effects: Iterable[AcceptedEffect], recording: Recording
) -> tuple[AcceptedEffect, ...]:
    """Those of a ``recording``'s effects that are the range limit which the scenario states too.

    A peak of one sample that was cut is not driven again: samples fall elsewhere on it. What the scenario says of its
    ADC and of its saturation needs no peak to show it.
    """
    return tuple(e for e in effects if e.id in SENSOR and _states(scenario, e, recording))


def _states(scenario: Scenario, effect: AcceptedEffect, recording: Recording) -> bool:
    """Whether every limit of the effect lies where the scenario's does: the same code, or on each side's own axes."""
    name = SENSOR[effect.id]
    part = getattr(scenario, name)
    is_same_unit = part.unit is getattr(recording, f"{name}_unit")
    codes = {p.name: p.value for p in effect.parameters if p.name.startswith(CODE)}
    limits = [p for p in effect.parameters if p.name.startswith("limit_")]
    for p in limits:
        axis, is_high = AXES.index(p.name[-2]), p.name.endswith("+")
        end = part.adc.high if is_high else part.adc.low
        if is_same_unit and abs(end - codes.get(CODE + p.name, np.inf)) <= part.adc.lsb:
            continue
        own = [part.electronics.saturation[axis] * (1.0 if is_high else -1.0)]
        if np.isfinite(end):
            raw = np.zeros(3)
            raw[axis] = end
            own.append(float(correct(raw, np.array(part.S), np.array(part.b))[axis]))
        if not abs(min(own, key=abs) - p.value) <= FRAME_TOLERANCE * abs(p.value) + 2.0 * p.std:
            return False
    return bool(limits)
