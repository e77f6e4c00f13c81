"""From a calibration to the start of the session fit, and from a fitted session to a linear model."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import numpy.typing as npt
from scipy.integrate import trapezoid

from trihedron.arrays import FloatArray
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Fit
from trihedron.diagnose.session.state import _LOWER, Prior, SessionState
from trihedron.records import Calibration
from trihedron.records.diagnosis import LinearModel
from trihedron.units import acceleration_to_si, rate_to_si

OPEN_BIAS_M_S2, OPEN_SCALE = 0.3, 0.03
"""Standard uncertainties above which the poses do not determine the accelerometer: bias, relative scale."""
WHOLE_SCALE = 0.01
"""Relative uncertainty of a gyro scale from table rotations taken as multiples of 90°."""
TYPICAL_BIAS_M_S2, TYPICAL_SCALE, TYPICAL_ANGLE = 0.5, 0.05, 0.03
"""Prior σ about a plain triad of nominal scale: bias, relative scale, axis angles (rad)."""
TABLE_TURN_RAD, WHOLE_TURN_RAD = 0.05, 0.07
"""Largest angle of the vertical in a rotation about it (3°); largest mean error of multiples of 90° (4°)."""
LEAST_ANGLE_RAD = 0.5
"""Angle between two verticals from which a move determines the gyro scale: errors of 1° each make it 5 % at worst."""
FEWEST_TURNS, BEST_MISS = 4, 0.5
"""Fewest rotations about an axis; largest error of the best trial scale over the median of all: rotations by arbitrary
angles differ from multiples of 90° by 22° at any scale."""


def lower_frame(S: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``(Q, L)`` with S = Q L, L lower triangular, the signs of its diagonal those of S where these are clear."""
    flip = np.eye(3)[::-1]
    q, r = np.linalg.qr(S @ flip)
    Q, L = q @ flip, flip @ r @ flip
    signs = np.where(np.sign(np.diag(L)) * np.sign(np.diag(S)) < 0, -1.0, 1.0)
    return Q * signs, signs[:, None] * L


def start_state(obs: Observations, calibration: Calibration) -> SessionState:
    """The calibration in the lower frame on centred readings, every pose at its measured vertical and bias."""
    _, L, b, gyro_S = _centred(obs, calibration)
    return _at_means(obs, calibration.gravity_m_s2, L, b, gyro_S)


def _centred(obs: Observations, calibration: Calibration) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Rotation to the lower frame, and there S, b of the accelerometer and S of the gyro on centred readings."""
    Q, L = lower_frame(calibration.accelerometer.S)
    gyro_S = np.eye(3) if calibration.gyroscope is None else Q.T @ calibration.gyroscope.S
    return Q, L, Q.T @ calibration.accelerometer.b + L @ obs.force_origin, gyro_S


def _at_means(
    obs: Observations, gravity: float, accel_S: FloatArray, accel_b: FloatArray, gyro_S: FloatArray
) -> SessionState:
    """A state without effects, the vertical and the gyro bias of every pose by its mean reading."""
    force, none = obs.pose_force @ accel_S.T + accel_b, np.zeros((obs.n_poses, 3))
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    bias = none if obs.pose_rate is None else obs.pose_rate @ gyro_S.T
    return SessionState(gravity, accel_S, accel_b, gyro_S, up, bias, none, np.zeros(0))


def is_open(calibration: Calibration) -> bool:
    """Whether the poses leave parameters of the accelerometer undetermined (too few faces up)."""
    sensor = calibration.accelerometer
    sigma = np.sqrt(np.diag(np.asarray(sensor.covariance))[:12])
    scale = float(np.abs(np.linalg.det(sensor.S))) ** (1.0 / 3.0)
    of_scales, of_biases = sigma[:9].max(), sigma[9:].max()
    return bool(of_biases > OPEN_BIAS_M_S2 or of_scales > OPEN_SCALE * scale)


def nominal_start(obs: Observations, calibration: Calibration) -> tuple[SessionState, Prior]:
    """Start for undetermined models: a plain triad of nominal scale, and a prior as wide as parts vary.

    The accelerometer's scale is that of its unit, or of counts the one that gives |g| in the typical pose; the gyro's
    that of its unit, or of counts the one that rotates gravity as the poses show. Axes are taken as documented.
    """
    known_scale = acceleration_to_si(obs.recording.accelerometer_unit)
    raw = obs.pose_force + obs.force_origin
    by_length = calibration.gravity_m_s2 / float(np.median(np.linalg.norm(raw, axis=1)))
    scale = by_length if known_scale is None else known_scale
    force = scale * raw
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    rate_scales, rate_sigma = np.ones(3), np.full(3, TYPICAL_SCALE)
    if obs.raw_rate is not None:
        known_rate = rate_to_si(obs.recording.gyroscope_unit)
        if known_rate is None:
            rate_scales, is_whole = _rate_scales_of_counts(obs, up)
            rate_sigma = np.where(is_whole, WHOLE_SCALE, TYPICAL_SCALE)
        else:
            rate_scales = np.full(3, known_rate)
    S, b = scale * np.eye(3), scale * obs.force_origin
    state = _at_means(obs, calibration.gravity_m_s2, S, b, np.diag(rate_scales))
    mean = np.concatenate([[state.accel_S[i, j] for i, j in _LOWER], state.accel_b, state.gyro_S.ravel()])
    lower = [(TYPICAL_SCALE if i == j else TYPICAL_ANGLE) * scale for i, j in _LOWER]
    full = [(rate_sigma[i] if i == j else TYPICAL_ANGLE) * rate_scales[j] for i in range(3) for j in range(3)]
    sigma = np.array([*lower, *[TYPICAL_BIAS_M_S2] * 3, *full])
    return state, Prior(mean, np.diag(sigma**2), is_weak=True)


def _rate_scales_of_counts(obs: Observations, up: FloatArray) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """(3,) gyro scales in counts: from the rotation of gravity between poses, then from rotations on a table.

    Rotations about the vertical leave gravity unchanged. If those about one axis are all near multiples of 90° for one
    scale near the first estimate (factor 0.8 to 1.25), that scale is used, and the second value (3,) is true.
    """
    assert obs.raw_rate is not None
    ratios, turns = [], []
    for (a, b), (before, after) in zip(obs.move_ranges, obs.move_poses, strict=True):
        angle = float(np.arccos(np.clip(up[before] @ up[after], -1.0, 1.0)))
        read = trapezoid(obs.raw_rate[a:b], obs.time_s[a:b], axis=0)
        if angle > LEAST_ANGLE_RAD and np.linalg.norm(read) > 0.0:
            ratios.append(angle / float(np.linalg.norm(read)))
        elif angle < TABLE_TURN_RAD:
            turns.append((int(np.abs(up[before]).argmax()), float(read @ up[before])))
    first = float(np.median(ratios)) if ratios else 1.0
    out, is_whole = np.full(3, first), np.zeros(3, dtype=bool)
    right = np.pi / 2.0
    for axis in range(3):
        read_angles = np.array([value for k, value in turns if k == axis and abs(value) * first > right / 2.0])
        if len(read_angles) < FEWEST_TURNS:
            continue
        trial = first * np.linspace(0.8, 1.25, 901)
        angles = np.abs(trial[:, None] * read_angles)
        miss = np.abs((angles + right / 2.0) % right - right / 2.0).mean(axis=1)
        if miss.min() < WHOLE_TURN_RAD and miss.min() < BEST_MISS * float(np.median(miss)):
            out[axis], is_whole[axis] = trial[miss.argmin()], True
    return out, is_whole


def prior_of(obs: Observations, calibration: Calibration) -> Prior:
    """A given calibration as a prior on the 18 unknowns, in the lower frame on centred readings."""
    Q, L, b, gyro_S = _centred(obs, calibration)
    mean = np.concatenate([[L[i, j] for i, j in _LOWER], b, gyro_S.ravel()])
    turn = np.kron(Q.T, np.eye(3))
    to_lower = np.zeros((6, 9))
    for k, (i, j) in enumerate(_LOWER):
        to_lower[k] = turn[3 * i + j]
    centred = np.kron(np.eye(3), obs.force_origin[None])  # b' = b + S origin
    A = np.zeros((18, 24))
    A[:6, :9] = to_lower
    A[6:9, :9] = centred @ turn
    A[6:9, 9:12] = Q.T
    A[9:18, 12:21] = turn
    cov = np.zeros((24, 24))
    given = calibration.covariance
    cov[: len(given), : len(given)] = given
    if calibration.gyroscope is None:
        cov[12:, 12:] = np.eye(12)
    out = A @ cov @ A.T
    # A published calibration without uncertainties is taken as exact to its last printed digits.
    floor = (1e-6 * np.maximum(np.abs(mean), 1e-3 * np.abs(mean).max())) ** 2
    out[np.diag_indices_from(out)] += floor
    return Prior(mean, out)


def linear_model(fitted: Fit) -> LinearModel:
    """S, b of both sensors from a fitted session, with standard errors, on raw readings; one bias for the session."""
    state, obs = fitted.state, fitted.obs
    covariance, gyro_b = fitted.linear
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    accel_b = fitted.core.session_force_bias - state.accel_S @ obs.force_origin
    accel, gyro = (
        MappingProxyType(
            {"S": S.tolist(), "b": b.tolist(), "sigma_S": own[:9].reshape(3, 3).tolist(), "sigma_b": own[9:].tolist(),
             "raw_unit": unit.value}
        )
        for S, b, own, unit in (
            (state.accel_S, accel_b, sigma[:12], obs.recording.accelerometer_unit),
            (state.gyro_S, gyro_b, sigma[12:], obs.recording.gyroscope_unit),
        )
    )  # fmt: skip
    return LinearModel(accel, None if obs.raw_rate is None else gyro)
