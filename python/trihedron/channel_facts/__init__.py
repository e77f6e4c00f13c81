"""Facts of channels, found in one place by one rule each: a recording carries them (``Recording.facts``)."""

from __future__ import annotations

from trihedron.arrays import FloatArray
from trihedron.channel_facts.step import converter_steps
from trihedron.records.channel_facts import ChannelFacts, RecordingFacts

__all__ = ["facts_of"]


def facts_of(accelerometer: FloatArray | None, gyroscope: FloatArray | None) -> RecordingFacts:
    """What raw readings (n, 3) of the sensors that are there say of their converters."""
    accel, gyro = (None if one is None else ChannelFacts(converter_steps(one)) for one in (accelerometer, gyroscope))
    return RecordingFacts(accel, gyro)
