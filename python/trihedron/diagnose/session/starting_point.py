"""From a calibration to the start of the session fit, and from a fitted session to a linear model."""

from typing import Any

import numpy as np
from scipy.linalg import block_diag

from trihedron.arrays import FloatArray
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Fit
from trihedron.records import Calibration, Recording, Segments, SensorCalibration
from trihedron.records.diagnosis import LinearModel
from trihedron.sensor_model import in_frame
from trihedron.session.model import LOWER, Prior, SessionState
from trihedron.transforms import directions_of
from trihedron.units import acceleration_to_si, rate_to_si

TYPICAL_BIAS_M_S2, TYPICAL_SCALE, TYPICAL_ANGLE = 0.5, 0.05, 0.03
"""How parts differ from a plain triad of nominal scale, one sigma: bias, relative scale, axis angles (rad). Poses that
leave the accelerometer as uncertain do not determine it."""
LEAST_ANGLE_RAD = 0.5
"""Angle between two verticals from which a move determines the gyro scale: errors of 1° each make it 5 % at worst."""
PUBLISHED_DIGITS = 1e-6
"""Relative standard uncertainty of a calibration published without one: its last printed digits."""


def start_state(obs: Observations, calibration: Calibration) -> SessionState:
    """The calibration in the lower frame on centred readings, every pose at its measured vertical and bias."""
    lower = in_frame(calibration, "lower")
    accel_S, gyro_S = lower.accelerometer.S, np.eye(3) if lower.gyroscope is None else lower.gyroscope.S
    accel_b = lower.accelerometer.b + accel_S @ obs.force_origin
    return obs.at_means(calibration.gravity_m_s2, accel_S, accel_b, gyro_S)


def prior_of(obs: Observations, calibration: Calibration, *, is_weak: bool = False) -> Prior:
    """A calibration as a prior on the 18 unknowns, in the lower frame on centred readings."""
    lower = in_frame(calibration, "lower")
    every = np.eye(24)
    bias = every[9:12].copy()
    bias[:, :9] = np.kron(np.eye(3), obs.force_origin)  # b' = b + S origin
    to_unknowns = np.concatenate([every[:9].reshape(3, 3, -1)[LOWER], bias, every[12:21]])
    sides = [(lower.accelerometer.S, lower.accelerometer.b), (np.eye(3), np.zeros(3))]
    covariance = every.copy()
    if lower.gyroscope is not None:
        sides[1] = lower.gyroscope.S, lower.gyroscope.b
    covariance[: len(lower.covariance), : len(lower.covariance)] = lower.covariance
    mean = to_unknowns @ np.concatenate([part.ravel() for side in sides for part in side])
    out = to_unknowns @ covariance @ to_unknowns.T
    # Zeros have no digits: they are as exact as a thousandth of the largest.
    out[np.diag_indices_from(out)] += (PUBLISHED_DIGITS * np.maximum(np.abs(mean), 1e-3 * np.abs(mean).max())) ** 2
    return Prior(mean, out, is_weak)


def is_open(calibration: Calibration) -> bool:
    """Whether the poses leave parameters of the accelerometer undetermined (too few faces up)."""
    sensor = calibration.accelerometer
    sigma = np.sqrt(np.diag(np.asarray(sensor.covariance))[:12])
    scale = float(np.abs(np.linalg.det(sensor.S))) ** (1.0 / 3.0)
    of_scales, of_biases = sigma[:9].max(), sigma[9:].max()
    return bool(of_biases > TYPICAL_BIAS_M_S2 or of_scales > TYPICAL_SCALE * scale)


def starts_nominal(calibration: Calibration) -> bool:
    """Whether the fit of a session starts from nominal values: its poses leave the accelerometer undetermined, or so
    many moves met the gyro's range limit that the others leave the gyro undetermined."""
    left_out = (f for f in calibration.findings if f.code == "gyroscope-left-out")
    return is_open(calibration) or any("n_lost" in f.numbers for f in left_out)


def nominal(recording: Recording, segments: Segments, gravity: tuple[float, str]) -> Calibration:
    """An orthogonal triad of nominal scale, with the typical spread of parts as uncertainty.

    Counts of the accelerometer are scaled by |g|, those of the gyro by the rotation of gravity from pose to pose.
    """
    assert recording.accelerometer is not None
    scale = acceleration_to_si(recording.accelerometer_unit)
    if scale is None:
        still = segments.accelerometer_mean
        typical = recording.accelerometer if still is None or not len(still) else still
        scale = gravity[0] / float(np.nanmedian(np.linalg.norm(typical, axis=1)))
    off = np.where(np.eye(3, dtype=bool), TYPICAL_SCALE, TYPICAL_ANGLE)

    def sensor(scale: float, b: FloatArray, sigma_S: FloatArray, sigma_b: FloatArray, raw: str, si: str) -> Any:
        covariance = np.diag(np.square([*sigma_S.ravel(), *sigma_b]))
        return SensorCalibration(scale * np.eye(3), b, covariance, raw, si, "diagnosis")

    accel_unit, spread = recording.accelerometer_unit.value, np.full(3, TYPICAL_BIAS_M_S2)
    accelerometer = sensor(scale, np.zeros(3), scale * np.tril(off), spread, accel_unit, "m/s^2")
    gyroscope = None
    if recording.gyroscope is not None:
        rate = rate_to_si(recording.gyroscope_unit) or _rate_of_count(recording, segments)
        bias = -rate * np.nanmedian(recording.gyroscope, axis=0)
        gyroscope = sensor(rate, bias, rate * off, np.abs(bias), recording.gyroscope_unit.value, "rad/s")
    covariance = block_diag(*(one.covariance for one in (accelerometer, gyroscope) if one is not None))
    return Calibration(accelerometer, gyroscope, covariance, "lower", *gravity)


def _rate_of_count(recording: Recording, segments: Segments) -> float:
    """Rate [rad/s] of one count: angle between the verticals before and after a move over the integral of its readings,
    median of all moves; 1 where gravity turns in none."""
    mean, bias = segments.accelerometer_mean, segments.gyroscope_mean
    if recording.gyroscope is None or mean is None or bias is None:
        return 1.0
    up = directions_of(mean)
    ratios = []
    for move in segments.moves:
        angle = float(np.arccos(np.clip(up[move.pose_before] @ up[move.pose_after], -1.0, 1.0)))
        away = recording.gyroscope[move.start : move.stop] - 0.5 * (bias[move.pose_before] + bias[move.pose_after])
        read = float(np.linalg.norm(np.nansum(away, axis=0))) / recording.rate_hz
        if angle > LEAST_ANGLE_RAD and read > 0.0:
            ratios.append(angle / read)
    return float(np.median(ratios)) if ratios else 1.0


def linear_model(fitted: Fit) -> LinearModel:
    """S, b of both sensors from a fitted session, on raw readings, with one bias for the session.

    With the full covariance of its parameters, in the order of a calibration file: S row by row, then b (eq. 11.16). It
    includes bias scatter from pose to pose, as that of a calibration does (eq. 11.12b).
    """
    state, obs, recording = fitted.state, fitted.obs, fitted.obs.recording
    covariance, gyro_b = fitted.core.linear_covariance(obs.force_origin, obs.rate_origin)
    accel_b = fitted.core.session_force_bias - state.accel_S @ obs.force_origin
    accel_unit, gyro_unit = recording.accelerometer_unit.value, recording.gyroscope_unit.value
    accel = SensorCalibration(state.accel_S, accel_b, covariance[:12, :12], accel_unit, "m/s^2", "diagnosis")
    if obs.raw_rate is None:
        return LinearModel.of_sensors(accel, None, covariance[:12, :12])
    gyro = SensorCalibration(state.gyro_S, gyro_b, covariance[12:, 12:], gyro_unit, "rad/s", "diagnosis")
    return LinearModel.of_sensors(accel, gyro, covariance)
