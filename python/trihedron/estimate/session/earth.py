"""The Earth's rotation in poses of unknown heading and in moves, where no model contains it."""

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.estimate.attitude import integrate_rate
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.gravity import unknown_earth_rate


def turned_with_earth(latitude_deg: float | None, up: FloatArray) -> FloatArray:
    """Covariances (n, 3, 3) [rad²/s²] of what is not known of the Earth's rotation in poses of unknown heading with
    directions ``up`` (n, 3)."""
    across, along = np.square(unknown_earth_rate(latitude_deg))
    return np.asarray(across * np.eye(3) + (along - across) * up[:, :, None] * up[:, None, :])


def left_by_earth(
    measured: MoveMeasurements, earth: FloatArray, S: FloatArray, moves: list[tuple[int, tuple[int, int]]]
) -> FloatArray:
    """Variances (m,) [rad²] along an axis that the Earth's rotation, of covariance ``earth`` (n, 3, 3) in each pose,
    adds to the integrals of ``moves`` (pose before, range of samples), beside biases that are linear between poses and
    contain it; ``S`` (3, 3) is the gyro's."""
    return np.array([
        left_in_move(earth[k], measured.time_s[a:b], (measured.rate[a:b] - measured.bias_read[k]) @ S.T)
        for k, (a, b) in moves
    ])  # fmt: skip


def left_in_move(earth: FloatArray, time_s: FloatArray, rate: FloatArray) -> float:
    """:func:`left_by_earth` of one move: ``time_s`` (n,), ``rate`` (n, 3) [rad/s]."""
    attitude = integrate_rate(time_s, rate)
    share = ((time_s - time_s[0]) / max(time_s[-1] - time_s[0], TINY))[:, None, None]
    between = (1.0 - share) * np.eye(3) + share * attitude[-1].T
    left = np.trapezoid(np.eye(3) - attitude @ between, time_s, axis=0)
    return float(np.trace(left @ earth @ left.T)) / 3.0
