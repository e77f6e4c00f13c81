"""Range limits that a scenario states, against those that a recording reaches."""

from collections.abc import Iterable

import numpy as np

from trihedron.arrays import AXES
from trihedron.comparison.effects import CODE, FRAME_TOLERANCE
from trihedron.records import Recording
from trihedron.records.diagnosis import AcceptedEffect
from trihedron.sensor_model import correct
from trihedron.simulate import Scenario

SENSOR = {"accel-saturation": "accelerometer", "gyro-saturation": "gyroscope"}
"""Sensor whose range limit an effect is."""


def stated_ranges(
    scenario: Scenario, effects: Iterable[AcceptedEffect], recording: Recording
) -> tuple[AcceptedEffect, ...]:
    """Those of a ``recording``'s effects that are a range limit which the scenario states too.

    A clipped peak of one sample is not clipped again in a simulation, whose samples fall elsewhere on it. The limits
    that the scenario states for its ADC and saturation count without such a peak.
    """
    return tuple(e for e in effects if e.id in SENSOR and _states(scenario, e, recording))


def _states(scenario: Scenario, effect: AcceptedEffect, recording: Recording) -> bool:
    """Whether every limit of the effect is the scenario's: the same code, or the same value along the sensor axes."""
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
