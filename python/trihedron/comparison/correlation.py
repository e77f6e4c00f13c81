"""How long the noise of a given simulation remembers against the recording's: correlation times of both sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping

from trihedron.channel_facts.pooled import ratio_of
from trihedron.comparison.noise import Sampled, Sensor
from trihedron.estimate.noise.correlation_time import correlation_time
from trihedron.records.diagnosis import NoiseDifference
from trihedron.records.pose_noise import Measured

TESTS = 48.0
"""Shares of alpha: what numbers (a half), noise (three eighths) and slow noise (a twelfth) leave, for two sensors."""
LEAST_TIME_RATIO = 2.0
"""Times of parts of one reel differ by half; makers state none."""
ALIKE = 1.25
"""Two sensors of one part whose times agree within a quarter have one and the same."""
SENSORS: tuple[Sensor, ...] = ("accelerometer", "gyroscope")


def correlation_times(model: Sampled, recording: Sampled, *, alpha: float) -> tuple[NoiseDifference, ...]:
    """A row for each sensor whose noise forgets within the poses of both logs; a time used for both is named."""
    times = {
        sensor: (correlation_time(model.noise[sensor]), correlation_time(recording.noise[sensor]))
        for sensor in SENSORS
        if sensor in model.noise and sensor in recording.noise
    }
    both = {sensor: (m, r) for sensor, (m, r) in times.items() if m is not None and r is not None}
    shared = _one_for_both(both, alpha)
    out = []
    for sensor, (m, r) in both.items():
        ratio = ratio_of(m, r)
        differs = ratio.p_value < alpha / TESTS and max(ratio.value, 1.0 / ratio.value) > LEAST_TIME_RATIO
        name = "gyro" if sensor == "gyroscope" else sensor
        remark = shared or f"The noise of the {name} forgets in {m.value:.2g} s, the recording's in {r.value:.2g} s."
        out.append(
            NoiseDifference(
                sensor, "", "correlation-time", m.value, r.value, ratio.value, (ratio.lower, ratio.upper), "s",
                ratio.p_value, differs, remark if differs else "",
            )
        )  # fmt: skip
    return tuple(out)


def _one_for_both(both: Mapping[Sensor, tuple[Measured, Measured]], alpha: float) -> str:
    """The words for a simulation that gives both sensors one time where the recording's differ; empty elsewhere."""
    if len(both) < len(SENSORS):
        return ""
    (m_a, r_a), (m_g, r_g) = (both[sensor] for sensor in SENSORS)
    model, recording = ratio_of(m_a, m_g), ratio_of(r_a, r_g)
    is_one = model.lower <= 1.0 <= model.upper and max(model.value, 1.0 / model.value) < ALIKE
    differ = recording.p_value < alpha / TESTS and max(recording.value, 1.0 / recording.value) > LEAST_TIME_RATIO
    if not (is_one and differ):
        return ""
    return (
        f"The noise of both sensors of the model forgets in the same time, {math.sqrt(m_a.value * m_g.value):.2g} s; "
        f"the recording's accelerometer in {r_a.value:.2g} s, its gyro in {r_g.value:.2g} s: one time constant was "
        "used for both."
    )
