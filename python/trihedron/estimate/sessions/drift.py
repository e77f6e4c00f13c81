"""How much the biases of one recording are expected to change until the next one."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.records import Calibration, Segments
from trihedron.session.noise import between_sessions


def bias_drift(calibration: Calibration, segments: Segments, n: int) -> FloatArray:
    """Variance (n,) of the bias change between two sessions like the calibrated one (eq. 9.3), 0 for other parameters,
    in the order of :data:`trihedron.records.sessions.PARAMETERS`."""
    out = np.zeros(n)
    accel, gyro = calibration.accelerometer, calibration.gyroscope
    quality = accel.quality
    if quality is not None and segments.accelerometer_mean is not None and len(quality.residual) > 3:
        up = segments.accelerometer_mean @ accel.S.T + accel.b
        up = up / np.linalg.norm(up, axis=1, keepdims=True)
        if len(up) == len(quality.residual):
            noise = quality.sigma**2 / max(quality.covariance_scale, 1.0)
            out[:3] = between_sessions(quality.residual, noise, np.einsum("ij,ij->i", up[1:], up[:-1]))
    if gyro is not None and segments.gyroscope_mean is not None and segments.gyroscope_sigma_mean is not None:
        biases = segments.gyroscope_mean @ gyro.S.T
        noise = (segments.gyroscope_sigma_mean**2) @ (gyro.S**2).T
        is_seen = np.all(np.isfinite(biases) & np.isfinite(noise), axis=1)
        if is_seen.sum() > 3:
            biases, noise = biases[is_seen] - biases[is_seen].mean(axis=0), noise[is_seen]
            out[9:12] = np.mean([between_sessions(biases[:, k], noise[:, k]) for k in range(3)])
    return out
