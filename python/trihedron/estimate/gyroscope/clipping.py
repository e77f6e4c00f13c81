"""Readings at the gyro's limit: bridged by a smooth peak, and made as uncertain as that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.records import Recording

LONGEST_BRIDGE_S = 0.15
"""A hand turns smoothly over this long; a peak cut for longer may have had any shape."""

DOUBT = 0.5
"""Standard error of the bridged area above the limit, as a part of that area."""


@dataclass(frozen=True, eq=False)
class Clipped:
    """``is_clipped`` (n, 3), ``readings`` (n, 3) with the peaks bridged, ``variance`` (n, 3) of each bridged
    reading."""

    is_clipped: BoolArray
    readings: FloatArray
    variance: FloatArray


def bridge_clipping(recording: Recording) -> Clipped | None:
    """Replace the gyro's runs at its limits by the cubic that continues the slopes on both sides; ``None`` without any.

    A cubic with slopes ``s₁, s₂`` at the ends of a run of length ``T`` has the area ``T² (s₁ − s₂)/12`` above the
    chord; half of it is taken for its standard error.

    Raises
    ------
    ValueError
        When the recording has no gyroscope.
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
    """Time (m,) that each move spent at the limit on any axis, s."""
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
    # Spread over the samples of the run so that their sum, taken as independent, has the variance of the area.
    variance[first : last + 1] = (DOUBT * area) ** 2 / count / (span / (count + 1)) ** 2
