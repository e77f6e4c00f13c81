"""Rows of the comparison of noise: one figure of a model and of a recording; range limits."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from trihedron.arrays import AXES
from trihedron.channel_facts.pooled import ratio_of
from trihedron.comparison.effects import CODE, FRAME_TOLERANCE
from trihedron.records import Recording
from trihedron.records.diagnosis import AcceptedEffect, NoiseDifference, NoiseTerm
from trihedron.records.pose_noise import Measured
from trihedron.records.words import words
from trihedron.sensor_model import correct
from trihedron.simulate import Scenario

Sensor = Literal["accelerometer", "gyroscope"]
SENSORS: tuple[Sensor, Sensor] = ("accelerometer", "gyroscope")
UNIT: Mapping[Sensor, str] = MappingProxyType({"accelerometer": "m/s^2", "gyroscope": "rad/s"})
NAMES: Mapping[Sensor, str] = MappingProxyType({"accelerometer": "accelerometer", "gyroscope": "gyro"})


def measured_row(
    sensor: Sensor,
    axis: str,
    term: NoiseTerm,
    pair: tuple[Measured, Measured],
    unit: str,
    least: float,
    alpha: float,
) -> NoiseDifference:
    """A figure that both sides have; it differs beyond chance and the ratio ``least``."""
    ratio = ratio_of(*pair)
    differs = bool(ratio.p_value < alpha and max(ratio.value, 1.0 / ratio.value) > least)
    return NoiseDifference(
        sensor, axis, term, pair[0].value, pair[1].value, ratio.value, (ratio.lower, ratio.upper), unit, ratio.p_value,
        differs, "",
    )  # fmt: skip


def remarked(row: NoiseDifference, phrase: str, **values: Any) -> NoiseDifference:
    """The row with a remark on its ratio, where it differs."""
    return replace(row, remark=words(phrase, ratio=row.ratio, **values)) if row.significant else row


def difference(
    sensor: Literal["accelerometer", "gyroscope", "both"],
    term: NoiseTerm,
    values: tuple[float | None, float | None],
    unit: str,
    remark: str,
    *,
    axis: str = "",
    ratio: float | None = None,
    p_value: float | None = None,
) -> NoiseDifference:
    """A figure of model and recording, ``values``, without an interval; it differs where there is a ``remark``."""
    return NoiseDifference(sensor, axis, term, *values, ratio, None, unit, p_value, bool(remark), remark)


# Range limits that a scenario states, against those that a recording reaches.

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
