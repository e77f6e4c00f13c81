"""The published residuals of a calibration whose S and b moved after the fit of its poses and moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.estimate.gyroscope.measurements import measure_moves
from trihedron.estimate.session.carried import carried
from trihedron.records.calibration import Calibration, FitQuality, SensorCalibration
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments
from trihedron.session.averaging import sharpened


def with_own_residuals(calibration: Calibration, recording: Recording, segments: Segments, paid: float) -> Calibration:
    """Residuals of poses and moves at the S and b that are saved; ``paid`` is by how much χ² of the moves rose.

    Predictions of fits that did not see a pose or move are of another model, and are left out.
    """
    accelerometer, gyroscope = calibration.accelerometer, calibration.gyroscope
    if accelerometer.quality is not None and segments.accelerometer_mean is not None:
        found = _of_poses(accelerometer, accelerometer.quality, segments, calibration.gravity_m_s2)
        accelerometer = replace(accelerometer, quality=found)
    if gyroscope is not None and gyroscope.quality is not None and gyroscope.quality.angle_deg is not None:
        found = _of_moves(calibration, gyroscope, gyroscope.quality, recording, segments)
        gyroscope = replace(gyroscope, quality=replace(found, chi2=found.chi2 + paid))
    return replace(calibration, accelerometer=accelerometer, gyroscope=gyroscope)


def _of_poses(sensor: SensorCalibration, quality: FitQuality, segments: Segments, gravity_m_s2: float) -> FitQuality:
    assert segments.accelerometer_mean is not None
    if len(quality.residual) != segments.n_poses:
        return quality
    residual = np.linalg.norm(segments.accelerometer_mean @ sensor.S.T + sensor.b, axis=1) - gravity_m_s2
    total = float(np.sum(residual**2))
    return replace(
        _seen_alone(quality),
        residual=residual,
        chi2=float(np.sum((residual / np.maximum(quality.sigma, 1e-300)) ** 2)),
        rms=float(np.sqrt(total / len(residual))),
        rms_dof=float(np.sqrt(total / quality.dof)) if quality.dof else float("nan"),
    )


def _of_moves(
    calibration: Calibration, gyro: SensorCalibration, quality: FitQuality, recording: Recording, segments: Segments
) -> FitQuality:
    accelerometer = calibration.accelerometer
    measured = measure_moves(recording, segments, accelerometer)
    if calibration.averaging:
        rate = sharpened(measured.rate, measured.time_s, calibration.averaging)
        measured = measured.of_rate(segments, rate, measured.reading_variance)
    anchors_s = segments.time_mid_s[measured.links]
    seen = carried(measured, anchors_s, accelerometer.S, accelerometer.b, gyro.S)
    known = np.ones(len(seen.angle_deg), dtype=bool) if quality.weights is None else quality.weights > 0.0
    total = float(np.sum((calibration.gravity_m_s2 * np.radians(seen.angle_deg[known])) ** 2))
    return replace(
        _seen_alone(quality),
        residual=seen.residual,
        angle_deg=seen.angle_deg,
        rms=float(np.sqrt(total / (2 * np.count_nonzero(known)))),
        rms_dof=quality.rms_dof * float(np.sqrt(total / (2 * np.count_nonzero(known)))) / quality.rms,
    )


def _seen_alone(quality: FitQuality) -> FitQuality:
    return replace(quality, held_out=None, held_out_sigma=None, held_out_rms=None, held_out_angle_deg=None)
