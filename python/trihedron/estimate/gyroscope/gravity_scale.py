"""The gyro's scale as gravity shows it, rough but enough to tell turns of 90, 180 and 360 degrees apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import REFUSALS
from trihedron.estimate.gyroscope.starts import MoveOptions
from trihedron.estimate.session.solved import calibrate_moves
from trihedron.records.calibration import SensorCalibration
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments

LARGEST_DOUBT = 0.1
"""Relative standard error above which a scale by gravity is not used: three of them still exclude half and twice."""
LEAST_TOLERANCE = 0.01
"""What a fit without findings may still be off by (nonlinearity, a hand that pushes)."""


@dataclass(frozen=True, eq=False)
class GravityScale:
    """``S`` (3, 3) rad/s per raw unit, and ``tolerance``, three relative standard errors of its worst direction."""

    S: FloatArray
    tolerance: float


def scale_by_gravity(
    recording: Recording, segments: Segments, accelerometer: SensorCalibration, gravity_m_s2: float
) -> GravityScale | None:
    """Scale of the gyro from the moves that turn gravity (method 2), or ``None`` where they do not tell it.

    Moves from face to face turn gravity by right angles, and turns on a table that is not level turn it a little: a
    scale that is off by a factor of two would miss it by tens of degrees.
    """
    if recording.gyroscope is None or recording.accelerometer is None:
        return None
    try:
        gyroscope, _ = calibrate_moves(recording, segments, accelerometer, gravity_m_s2, MoveOptions(n_folds=0))
    except REFUSALS:
        return None
    quality, seen = gyroscope.quality, gyroscope.observability
    if quality is None or seen is None or seen.rank < seen.n_parameters or quality.angle_deg is None:
        return None
    size = float(np.linalg.norm(gyroscope.S, 2))
    sigma = float(np.sqrt(max(np.linalg.eigvalsh(gyroscope.covariance[:9, :9])[-1], 0.0))) / size
    if not sigma < LARGEST_DOUBT:
        return None
    return GravityScale(gyroscope.S, max(3.0 * sigma, LEAST_TOLERANCE))
