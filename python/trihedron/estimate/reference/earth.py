"""The Earth's rate in a log held against motion that is known relative to a room.

A gyro reads its rate against inertial space, ``ω = ω_room + Cᵀ e`` with C the attitude in the room and e the Earth's
rate along the room's axes: 15.04°/h long, pointing nobody knows where. As the vector of unknown direction it has the
prior N(0, |e|²/3 I); a log that tells it, tells it with its length.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trihedron._core import rotation_from_vector
from trihedron.arrays import FloatArray
from trihedron.estimate.reference.together import Grid, Reference
from trihedron.estimate.reference.windows import Windows
from trihedron.gravity import EARTH_RATE_RAD_S

RESOLVED = 1.0 / 3.0
"""A vector known to a third of its length has a direction."""
FAR = 3.0
"""Standard errors by which a vector may be shorter than the Earth's."""


@dataclass(frozen=True, eq=False)
class EarthColumns:
    """What one rad/s along each axis of the room adds to the rate that a fit predicts, (k, 3, 3).

    ``is_told``: attitude is known, so the log may say where the vector points; else it only counts in the error bars.
    """

    values: FloatArray
    is_told: bool
    sigma: float = EARTH_RATE_RAD_S / math.sqrt(3.0)


@dataclass(frozen=True, eq=False)
class EarthRate:
    """The vector (3,) along the room's axes [rad/s], its covariance (3, 3), and whether the log told its direction."""

    value: FloatArray
    covariance: FloatArray
    is_resolved: bool


def earth_columns(
    grid: Grid, reference: Reference, windows: Windows, offset_s: float, rate: float
) -> EarthColumns | None:
    """Columns beside a gyro's numbers; ``None`` where the reference is another unit, which feels the Earth as well.

    With rates alone the attitude is their sum: a few degrees off after minutes, of a vector that hardly shows.
    """
    motion = reference.motion
    if motion.specific_force is not None:
        return None
    time = grid.time_s * (1.0 + rate) + offset_s
    if motion.attitude is not None:
        C = windows.of(windows.weight, reference.attitude(time))
        return EarthColumns(np.asarray(-np.swapaxes(C, 1, 2)), is_told=True)
    at = time[windows.middle]
    turns = reference.rate(at) * np.diff(at, prepend=at[0])[:, None]
    C = np.empty((len(at), 3, 3))
    now = np.eye(3)
    for k, step in enumerate(rotation_from_vector(np.ascontiguousarray(turns))):
        now = now @ step
        C[k] = now
    return EarthColumns(np.asarray(-np.swapaxes(C, 1, 2)), is_told=False)


def earth_rate(left: FloatArray, columns: FloatArray, variance: float, given: EarthColumns) -> EarthRate:
    """The vector from residuals ``left`` (n,) and its ``columns`` (n, 3) there, free of all that the fit takes up.

    ``variance`` is that of a residual, as blocks of time show it.
    """
    prior = np.eye(3) / given.sigma**2
    if not given.is_told:
        return EarthRate(np.zeros(3), given.sigma**2 * np.eye(3), is_resolved=False)
    told = columns.T @ columns / variance
    covariance = np.linalg.inv(told + prior)
    value = covariance @ (columns.T @ left) / variance
    is_resolved = float(np.linalg.eigvalsh(told)[0]) > 3.0 / (RESOLVED * EARTH_RATE_RAD_S) ** 2
    if is_resolved:
        # A reference that a gyro carried turns with the Earth itself: then nothing of that length is there.
        alone = np.linalg.solve(told, columns.T @ left) / variance
        short = EARTH_RATE_RAD_S - float(np.linalg.norm(alone))
        is_resolved = short < FAR * float(np.sqrt(np.trace(np.linalg.inv(told)) / 3.0))
    if is_resolved:
        # Its length is known: the component along itself is no question.
        along = value / np.linalg.norm(value)
        gain = covariance @ along / float(along @ covariance @ along)
        value = value + gain * (EARTH_RATE_RAD_S - float(np.linalg.norm(value)))
        covariance = covariance - np.outer(gain, covariance @ along)
    return EarthRate(np.asarray(value), np.asarray(0.5 * (covariance + covariance.T)), is_resolved)
