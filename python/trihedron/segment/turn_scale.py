"""Roughly how many radians a raw gyro reading is worth: enough to tell a support that creeps from a body that turns."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.ranges import Range
from trihedron.records import Recording
from trihedron.segment.channels import Channels
from trihedron.units import rate_to_si

LEAST_TURN_RAD = 0.3
"""Gravity must turn by this much between two stretches to weigh the gyro's path against it."""
USUAL = 80.0
"""Percentile over the moves of gravity's turn over the gyro's path: near one where a move is direct and about a level
axis, less for all others."""


def radians_per_reading(
    recording: Recording, channels: Channels, ranges: list[Range], centre: FloatArray
) -> float | None:
    """Scale [rad/s per raw unit] by the unit, or by how far gravity turns between quiet stretches; to a factor of two.

    ``None`` in counts where no move turns gravity.
    """
    unit = rate_to_si(recording.gyroscope_unit)
    if unit is not None:
        return unit
    gyro = channels.is_gyroscope
    if not gyro.any() or gyro.all():
        return None
    ratios = []
    for (a, b), (c, d) in pairwise(ranges):
        before, after = channels.mean[b - 1], channels.mean[c]
        f, g = before[~gyro] - centre, after[~gyro] - centre
        size = float(np.linalg.norm(f) * np.linalg.norm(g))
        if size == 0.0:
            continue
        angle = float(np.arccos(np.clip(f @ g / size, -1.0, 1.0)))
        if angle < LEAST_TURN_RAD:
            continue
        zero = 0.5 * (channels.mean[a:b][:, gyro].mean(axis=0) + channels.mean[c:d][:, gyro].mean(axis=0))
        rate = channels.mean[b:c][channels.is_valid[b:c]][:, gyro] - zero
        path = float(np.linalg.norm(rate, axis=1).sum()) * channels.step_s
        if path > 0.0:
            ratios.append(angle / path)
    return float(np.percentile(ratios, USUAL)) if ratios else None


def centre_of(recording_is_counts: bool, channels: Channels, quiet: BoolArray) -> FloatArray:
    """(3,) accelerometer reading without force: zero in a unit, the middle of the quiet readings in counts."""
    if not recording_is_counts or not quiet.any():
        return np.zeros(3)
    reading = channels.mean[quiet][:, ~channels.is_gyroscope]
    out: FloatArray = 0.5 * (reading.min(axis=0) + reading.max(axis=0))
    return out
