"""Facts of channels (noise, LSB, limits), found in one place; a recording carries them (``Recording.facts``)."""

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.channel_facts.limits import Extremes, find_limits
from trihedron.channel_facts.quiet import Windows, look
from trihedron.channel_facts.static_axes import adc_steps
from trihedron.records.channel_facts import ChannelFacts, RecordingFacts

__all__ = ["facts_in", "facts_of"]


def facts_of(sensors: dict[str, FloatArray], rate_hz: float) -> RecordingFacts:
    """Noise, LSB and limits in raw readings (n, 3) of the sensors present, by name, sampled at a rate."""
    return facts_in(sensors, look(sensors, rate_hz))


# Absurd readings (1e300) overflow squares; their noise is infinite then.
@np.errstate(over="ignore", invalid="ignore")
def facts_in(
    sensors: dict[str, FloatArray], windows: Windows | None, extremes: dict[str, Extremes] | None = None
) -> RecordingFacts:
    """The facts of sensors (n, 3) by name whose quiet windows, and perhaps extremes, are known."""
    facts: dict[str, ChannelFacts] = {}
    for name, readings in sensors.items():
        step = adc_steps(readings)
        noise = np.zeros(3) if windows is None else windows.quiet_noise(name)
        facts[name] = ChannelFacts(step, noise, find_limits(readings, noise, step, (extremes or {}).get(name)))
    return RecordingFacts(facts.get("accelerometer"), facts.get("gyroscope"))
