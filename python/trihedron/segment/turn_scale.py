"""Roughly how many radians a gyro reading is worth: enough to know a support that settles from a body that turns."""

from __future__ import annotations

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.quantiles import quantile
from trihedron.ranges import Range
from trihedron.records import Recording
from trihedron.segment.channels import Channels
from trihedron.units import rate_to_si

LEAST_TURN_RAD = 0.3
"""Gravity must turn by this much between two stretches to weigh the gyro's path against it."""
USUAL = 0.8
"""Quantile over the moves of gravity's turn over the gyro's path: near one where a move is direct and about a level
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
    edges = np.array(ranges, dtype=np.int64).reshape(-1, 2)
    zeros = _core.column_means(channels.mean, edges, np.arange(len(edges)), len(edges))[:, gyro]
    force = channels.mean[:, ~gyro] - centre
    before, after = force[edges[:-1, 1] - 1], force[edges[1:, 0]]
    size = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    cosine = np.sum(before * after, axis=1) / np.where(size > 0.0, size, 1.0)
    angle = np.where(size > 0.0, np.arccos(np.clip(cosine, -1.0, 1.0)), 0.0)
    # Of every block between two stretches: which two, and how fast the gyro turned.
    length = edges[1:, 0] - edges[:-1, 1]
    move = np.repeat(np.arange(len(length)), length)
    block = np.arange(len(move)) + (edges[1:, 0] - np.cumsum(length))[move]
    zero = 0.5 * (zeros[:-1] + zeros[1:])
    rate = np.linalg.norm(channels.mean[block][:, gyro] - zero[move], axis=1)
    path = np.bincount(move, np.where(channels.is_valid[block], rate, 0.0), len(angle)) * channels.step_s
    told = (angle >= LEAST_TURN_RAD) & (path > 0.0)
    return quantile(angle[told] / path[told], USUAL) if told.any() else None


def centre_of(recording_is_counts: bool, channels: Channels, quiet: BoolArray) -> FloatArray:
    """(3,) accelerometer reading without force: zero in a unit, the middle of the quiet readings in counts."""
    if not recording_is_counts or not quiet.any():
        return np.zeros(3)
    reading = channels.mean[quiet][:, ~channels.is_gyroscope]
    out: FloatArray = 0.5 * (reading.min(axis=0) + reading.max(axis=0))
    return out
