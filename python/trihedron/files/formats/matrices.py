"""Matrix factors in the conventions of other programs."""

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.files.formats.contract import ExportOptions, of_si_readings
from trihedron.records import Calibration, SensorCalibration
from trihedron.sensor_model import in_frame, other_form


def in_lower(
    calibration: Calibration, target: str, options: ExportOptions
) -> tuple[Calibration, FloatArray, FloatArray]:
    """The calibration of SI readings in the lower-triangular frame, and M, b of ``reading = M force + b``."""
    lower = in_frame(calibration, "lower") if calibration.frame != "lower" else calibration
    lower = of_si_readings(lower, target, options)
    M, b = other_form(lower.accelerometer.S, lower.accelerometer.b)
    return lower, np.tril(M), b


def lower_orthogonal(A: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``A = L Q`` with L lower triangular and Q a proper rotation, det Q = +1.

    The diagonal of L is positive where det A > 0. For a mirrored triad one diagonal element of L is negative, in the
    axis whose diagonal element of Q is smallest, so that Q contains no reflection.
    """
    q, r = np.linalg.qr(A.T)
    signs = np.where(np.diag(r) < 0.0, -1.0, 1.0)
    L, Q = (r * signs[:, None]).T, (q * signs).T
    if np.linalg.det(Q) < 0.0:
        flip = np.ones(3)
        flip[int(np.argmin(np.diag(Q)))] = -1.0
        L, Q = L * flip, flip[:, None] * Q
    return L, Q


def upper_frame(calibration: Calibration) -> tuple[FloatArray, list[tuple[SensorCalibration, FloatArray, FloatArray]]]:
    """Both sensors rotated by R so that the accelerometer's S is upper triangular: R and (sensor, R S, R b)."""
    q, r = np.linalg.qr(calibration.accelerometer.S)
    # The diagonal keeps its signs: a left-handed triad is not corrected by a reflection of the body frame.
    rotation = (q * (np.sign(np.diag(r)) * np.sign(np.diag(calibration.accelerometer.S)))).T
    turned = [(sensor, rotation @ sensor.S, rotation @ sensor.b) for _, sensor in calibration.sensors]
    # Rounding errors below the diagonal are set to 0, as the target expects.
    turned[0] = (turned[0][0], np.triu(turned[0][1]), turned[0][2])
    return rotation, turned
