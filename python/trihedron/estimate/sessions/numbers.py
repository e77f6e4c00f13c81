"""A calibration as parameters that do not depend on the frame, with their covariance."""

import math
from collections.abc import Sequence

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.sessions.changes import bias_drift
from trihedron.invariants import Anchor, anchor_of, numbers_jacobian, numbers_of
from trihedron.records import Calibration, SensorCalibration
from trihedron.records.recording import distinct_names
from trihedron.records.results import CalibrationResult
from trihedron.records.sessions import Session
from trihedron.sensor_model import in_frame

HEATING_DEGC = 1.0
"""Change of temperature over a recording from which it counts as heating or cooling: built-in thermometers have a
resolution of 0.1 to 0.5 °C."""


def sessions_of(results: Sequence[CalibrationResult], groups: Sequence[str]) -> tuple[Session, ...]:
    """Calibrations as frame-independent parameters, relative to the axes of the first one."""
    *_, anchor = numbers_with_covariance(results[0].calibration)
    names = distinct_names([result.recording.source for result in results])
    return tuple(
        session_of(result, anchor, name, group) for result, name, group in zip(results, names, groups, strict=True)
    )


def numbers_with_covariance(
    calibration: Calibration, anchor: Anchor | None = None
) -> tuple[FloatArray, FloatArray, Anchor]:
    """Frame-independent parameters (n,), their covariance (n, n), and their anchor, by default its own."""
    lower = in_frame(calibration, "lower")
    accel, gyro = lower.accelerometer, lower.gyroscope
    S_g, b_g = (None, None) if gyro is None else (gyro.S, gyro.b)
    anchor = anchor or anchor_of(accel.S, S_g)
    jacobian = numbers_jacobian(accel.S, accel.b, S_g, b_g)
    covariance = jacobian @ lower.covariance @ jacobian.T
    return numbers_of(accel.S, accel.b, S_g, b_g, anchor), 0.5 * (covariance + covariance.T), anchor


def session_of(result: CalibrationResult, anchor: Anchor | None, name: str, group: str) -> Session:
    """One calibration as parameters with their covariance."""
    numbers, covariance, _ = numbers_with_covariance(result.calibration, anchor)
    calibration, recording = in_frame(result.calibration, "lower"), result.recording
    temperature, low, high, branch = _temperature(result)
    return Session(
        name,
        group,
        numbers,
        covariance,
        bias_drift(calibration, result.segments, len(covariance)),
        recording.start_epoch_s,
        temperature,
        (low, high),
        branch,
        recording.sha256,
        *_gravity_error(calibration.accelerometer),
    )


def _gravity_error(sensor: SensorCalibration) -> tuple[float, float]:
    """Cross-validated rms in the poses [m/s²], and over noise alone."""
    quality = sensor.quality
    if quality is None or quality.held_out_rms is None or not quality.floor > 0.0:
        return math.nan, math.nan
    return quality.held_out_rms, quality.held_out_rms / quality.floor


def _temperature(result: CalibrationResult) -> tuple[float, float, float, int]:
    """Mean, least and largest temperature of the poses, and +1 for heating, -1 for cooling, else 0."""
    T = result.recording.temperature_degc
    if T is None:
        return math.nan, math.nan, math.nan, 0
    means = [
        float(np.nanmean(T[h.start : h.stop])) for h in result.segments.poses if np.isfinite(T[h.start : h.stop]).any()
    ]
    if not means:
        return math.nan, math.nan, math.nan, 0
    rise = means[-1] - means[0]
    return float(np.mean(means)), min(means), max(means), 0 if abs(rise) < HEATING_DEGC else int(np.sign(rise))
