"""Clipped gyro readings: replaced by a smooth peak, with the variance of the replacement."""

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.records import Recording

LONGEST_BRIDGE_S = 0.15
"""Longest clipped run that is bridged: rotation by hand is smooth over this time; a longer peak may have any shape."""

DOUBT = 0.5
"""Standard uncertainty of the bridged area above the range limit, relative to that area."""


@dataclass(frozen=True, eq=False)
class Clipped:
    """``is_clipped`` (n, 3), raw ``readings`` (n, 3) with the peaks bridged, ``variance`` (n, 3) of each bridged
    reading, raw²."""

    is_clipped: BoolArray
    readings: FloatArray
    variance: FloatArray


def bridge_clipping(recording: Recording) -> Clipped | None:
    """Replace the gyro's clipped runs by the cubic that continues the slopes on both sides; ``None`` without a limit.

    A cubic with slopes ``s₁, s₂`` at the ends of a run of length ``T`` has the area ``T² (s₁ − s₂)/12`` above the
    chord; its standard uncertainty is ``DOUBT`` of it. Raises ``InputError`` when the recording has no gyroscope.
    """
    facts, gyroscope = recording.facts.of("gyroscope"), recording.gyroscope
    if gyroscope is None or not facts.limits:
        return None
    readings, variance = gyroscope.copy(), np.zeros(gyroscope.shape)
    for limit in facts.limits:
        for first, stop in limit.runs.tolist():
            _bridge(recording.time_s, readings[:, limit.axis], variance[:, limit.axis], first, stop - 1)
    return Clipped(facts.at_limits(len(gyroscope)), readings, variance)


def clipped_time(clipped: Clipped | None, edges: IntArray, step_s: float) -> FloatArray:
    """Time (m,) in each move with any axis at the range limit, s."""
    if clipped is None:
        return np.zeros(len(edges))
    any_axis = np.any(clipped.is_clipped, axis=1)
    return np.array([step_s * float(np.count_nonzero(any_axis[a:b])) for a, b in edges])


def _bridge(time_s: FloatArray, column: FloatArray, variance: FloatArray, first: int, last: int) -> None:
    left, right = first - 1, last + 1
    if left < 1 or right > len(column) - 2:
        return
    span = time_s[right] - time_s[left]
    before, after = time_s[left] - time_s[left - 1], time_s[right + 1] - time_s[right]
    if span <= 0.0 or before <= 0.0 or after <= 0.0:
        return
    enter = (column[left] - column[left - 1]) / before
    leave = (column[right + 1] - column[right]) / after
    u = (time_s[first : last + 1] - time_s[left]) / span
    column_left, column_right = column[left], column[right]
    column[first : last + 1] = (
        (2 * u**3 - 3 * u**2 + 1) * column_left
        + (u**3 - 2 * u**2 + u) * span * enter
        + (3 * u**2 - 2 * u**3) * column_right
        + (u**3 - u**2) * span * leave
    )
    area = span**2 * abs(enter - leave) / 12.0
    count = last - first + 1
    # Equal and independent variances of the run's samples, whose integral has the variance of the area.
    variance[first : last + 1] = (DOUBT * area) ** 2 / count / (span / (count + 1)) ** 2
