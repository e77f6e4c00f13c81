"""Rows of the comparison of noise: one figure of a model and of a recording."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal

from trihedron.channel_facts.pooled import ratio_of
from trihedron.records.diagnosis import NoiseDifference, NoiseTerm
from trihedron.records.pose_noise import Measured
from trihedron.records.words import words

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
