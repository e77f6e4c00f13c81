"""The gyro's scale from gravity: rough, but sufficient to distinguish turns of 90, 180 and 360 degrees."""

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
"""Largest relative standard uncertainty of a scale that is used: three of them still exclude half and twice."""
LEAST_TOLERANCE = 0.01
"""Smallest tolerance: errors that the fit does not show (nonlinearity, accelerations of the hand)."""


@dataclass(frozen=True, eq=False)
class GravityScale:
    """``S`` (3, 3) rad/s per raw unit; ``tolerance``: 3 relative standard uncertainties of its worst direction."""

    S: FloatArray
    tolerance: float


def scale_by_gravity(
    recording: Recording, segments: Segments, accelerometer: SensorCalibration, gravity_m_s2: float
) -> GravityScale | None:
    """Scale of the gyro from moves that change gravity's direction (method 2), or ``None`` if they do not determine it.

    Moves from face to face rotate gravity by 90°, turns on a tilted table by a little: with a scale wrong by a factor
    of two the tilt errors would be tens of degrees.
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
