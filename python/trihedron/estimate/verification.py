"""A calibration against a recording that it was not made from: norm of gravity at rest, gravity carried through
moves."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import numpy.typing as npt
from scipy import stats

from trihedron import _core
from trihedron.estimate.gyroscope.measurements import measure_moves
from trihedron.records import (
    Calibration,
    Finding,
    FindingCode,
    Recording,
    Segments,
    SensorCalibration,
    Severity,
    Verification,
)
from trihedron.units import degrees_from_radians, mg_from_m_s2

FloatArray = npt.NDArray[np.float64]

FALSE_ALARM = 1e-3
"""Chance that a calibration that holds is said to be exceeded."""
FAR_BEYOND = 10.0
"""A miss this many times what noise and stated errors allow: the calibration is not this sensor's, or no longer.
Other sessions of one unit reach 0.5 to 3 at rest and 2 to 9 through moves (kim, mimu4444, phone), another unit 8 to 60.
"""


def verify_calibration(
    calibration: Calibration,
    recording: Recording,
    segments: Segments,
    gravity_m_s2: float,
    gravity_source: str,
) -> Verification:
    """Judge a calibration by the still poses and moves of another recording (equations 3.1 and 5.1, nothing fitted).

    Raises
    ------
    ValueError
        When the recording has no accelerometer or no still pose.
    """
    if recording.accelerometer is None or segments.accelerometer_mean is None:
        raise ValueError("verification needs the accelerometer: gravity is what a calibration is tested against")
    if segments.n_holds == 0:
        raise ValueError("verification needs still poses, and none was found: hold the sensor still for some seconds")
    accelerometer = calibration.accelerometer
    noise = _variance(segments.accelerometer_sigma_mean, segments.n_holds)
    force = segments.accelerometer_mean @ accelerometer.S.T + accelerometer.b
    error, error_noise, error_sigma = norm_error(accelerometer, segments.accelerometer_mean, noise, gravity_m_s2)
    empty = np.zeros(0)
    angle, angle_noise, angle_sigma = empty, empty, empty
    rest = np.zeros((0, 3))
    gyroscope = calibration.gyroscope
    if gyroscope is not None and segments.gyroscope_mean is not None:
        rest = segments.gyroscope_mean @ gyroscope.S.T + gyroscope.b
        if any(move.stop - move.start >= 2 for move in segments.moves):
            angle, angle_noise, angle_sigma = _carried(calibration, gyroscope, recording, segments, force)
    return Verification(
        source=recording.source,
        sha256=recording.sha256,
        gravity_m_s2=gravity_m_s2,
        gravity_source=gravity_source,
        norm_error=error,
        norm_noise=error_noise,
        norm_sigma=error_sigma,
        angle_deg=angle,
        angle_noise_deg=angle_noise,
        angle_sigma_deg=angle_sigma,
        rest_rate=rest,
        findings=(*_norm_findings(error, error_sigma), *_angle_findings(angle, angle_sigma)),
    )


def norm_error(
    sensor: SensorCalibration, means: FloatArray, variance: FloatArray, gravity_m_s2: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """``|S a' + b| - |g|`` (n,) of mean readings (n, 3), its noise, and its noise with the calibration's uncertainty.

    With ``u = f/|f|``: ``var = uᵀ S Σ Sᵀ u + J C Jᵀ``, ``J = (u ⊗ a', u)``.
    """
    force = means @ sensor.S.T + sensor.b
    norm = np.linalg.norm(force, axis=1)
    up = force / norm[:, None]
    along = up @ sensor.S
    noise = np.sum(along**2 * variance, axis=1)
    jacobian = np.concatenate([(up[:, :, None] * means[:, None, :]).reshape(-1, 9), up], axis=1)
    model = np.einsum("ni,ij,nj->n", jacobian, sensor.covariance, jacobian)
    return norm - gravity_m_s2, np.sqrt(noise), np.sqrt(noise + np.maximum(model, 0.0))


def _variance(sigma: FloatArray | None, n: int) -> FloatArray:
    return np.zeros((n, 3)) if sigma is None else np.asarray(sigma) ** 2


def _carried(
    calibration: Calibration,
    gyroscope: SensorCalibration,
    recording: Recording,
    segments: Segments,
    force: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angles [deg] between gravity carried through each move and gravity measured after it, and their sigmas."""
    measured = measure_moves(recording, segments, calibration.accelerometer, 3)
    zero = -measured.zero @ gyroscope.S.T
    assert recording.gyroscope is not None
    rotation, wrt_scale, wrt_before, wrt_after, cov_rate = _core.integrate_moves(
        recording.time_s,
        recording.gyroscope,
        measured.edges,
        np.ascontiguousarray(segments.time_mid_s[measured.links]),
        gyroscope.S,
        np.ascontiguousarray(zero[measured.links[:, 0]]),
        np.ascontiguousarray(zero[measured.links[:, 1]]),
        3,
        measured.noise_density,
        measured.sigma_time_s,
        measured.nominal_step_s,
    )
    unit = force / np.linalg.norm(force, axis=1)[:, None]
    before, after = unit[measured.links[:, 0]], unit[measured.links[:, 1]]
    carried = np.einsum("mij,mj->mi", rotation, before)
    angle = 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(carried - after, axis=1), 1.0))
    # Across the vertical only: two components of the direction's error.
    across = np.eye(3) - before[:, :, None] * before[:, None, :]
    S_a, g = calibration.accelerometer.S, calibration.gravity_m_s2
    of_direction = np.einsum("ij,nj,kj->nik", S_a, measured.var_reading, S_a) / g**2
    of_zero = np.einsum("ij,nj,kj->nik", gyroscope.S, measured.var_zero, gyroscope.S)
    first, last = measured.links[:, 0], measured.links[:, 1]
    skew = _cross_matrices(before)

    def turned(theta: FloatArray) -> FloatArray:
        """What a rotation vector does to the direction carried."""
        moved: FloatArray = skew @ theta
        return moved

    def spread(part: FloatArray, covariance: FloatArray) -> FloatArray:
        out: FloatArray = part @ covariance @ np.swapaxes(part, 1, 2)
        return out

    # The two means enter in frames that the move turns into one another; a trace does not mind.
    noise = of_direction[first] + np.swapaxes(rotation, 1, 2) @ of_direction[last] @ rotation
    noise = noise + spread(skew, cov_rate)
    noise = noise + spread(turned(wrt_before), of_zero[first]) + spread(turned(wrt_after), of_zero[last])
    # Zero readings are subtracted: S enters through wrt_scale and through the biases -S z.
    wrt_S = np.asarray(wrt_scale).copy()
    for i in range(3):
        wrt_S[:, :, 3 * i : 3 * i + 3] -= (
            wrt_before[:, :, i : i + 1] * measured.zero[first][:, None, :]
            + wrt_after[:, :, i : i + 1] * measured.zero[last][:, None, :]
        )
    model = spread(turned(wrt_S), np.broadcast_to(gyroscope.covariance[:9, :9], (len(angle), 9, 9)))
    noise_rms = np.sqrt(np.einsum("mij,mji->m", across, noise))
    total_rms = np.sqrt(np.einsum("mij,mji->m", across, noise + model))
    return np.degrees(angle), np.degrees(noise_rms), np.degrees(total_rms)


def _cross_matrices(vectors: FloatArray) -> FloatArray:
    out = np.zeros((len(vectors), 3, 3))
    out[:, 0, 1], out[:, 0, 2] = -vectors[:, 2], vectors[:, 1]
    out[:, 1, 0], out[:, 1, 2] = vectors[:, 2], -vectors[:, 0]
    out[:, 2, 0], out[:, 2, 1] = -vectors[:, 1], vectors[:, 0]
    return out


def _norm_findings(error: FloatArray, sigma: FloatArray) -> list[Finding]:
    z2 = (error / sigma) ** 2
    if stats.chi2.sf(float(z2.sum()), len(z2)) > FALSE_ALARM:
        return []
    rms = float(np.sqrt(np.mean(error**2)))
    times = float(np.sqrt(np.mean(z2)))
    return [
        Finding(
            FindingCode.RESIDUAL_ABOVE_NOISE,
            Severity.SERIOUS if times > FAR_BEYOND else Severity.WARNING,
            f"Gravity at rest is missed by {rms:.3g} m/s² rms ({mg_from_m_s2(rms):.2g} mg), "
            f"{times:.1f} times what noise and the stated errors of the calibration allow.",
            "The sensor has changed since (temperature, shock, supply), gravity is another here, or poses were "
            "not still.",
            "Calibrate again near the conditions of use; compare the two calibrations.",
            MappingProxyType({"norm_rms_m_s2": rms, "chi2_per_pose": times**2, "times_expected": times}),
        )
    ]


def _angle_findings(angle_deg: FloatArray, sigma_deg: FloatArray) -> list[Finding]:
    if not len(angle_deg):
        return []
    # Two components per move share the variance sigma², so the squared ratio has mean one and two degrees of freedom.
    z2 = 2.0 * (angle_deg / sigma_deg) ** 2
    if stats.chi2.sf(float(z2.sum()), 2 * len(z2)) > FALSE_ALARM:
        return []
    rms = float(np.sqrt(np.mean(angle_deg**2)))
    worst = int(np.argmax(angle_deg))
    times = float(np.sqrt(np.mean(z2) / 2.0))
    return [
        Finding(
            FindingCode.HELD_OUT_WORSE,
            Severity.SERIOUS if times > FAR_BEYOND else Severity.WARNING,
            f"Gravity carried through the moves by the gyro is missed by {rms:.3g}° rms (worst move {worst}: "
            f"{angle_deg[worst]:.3g}°), {times:.1f} times what noise and the stated errors allow.",
            "The gyro's scale has changed since, it clipped, samples were lost, or a pose was not still.",
            "Look at the worst moves; calibrate again near the conditions of use.",
            MappingProxyType({"angle_rms_deg": rms, "worst_move": float(worst), "times_expected": times}),
        )
    ]


def zero_shift_deg_s(verification: Verification) -> float:
    """Largest mean rate at rest [deg/s]: how far the zero has moved since the calibration."""
    if not len(verification.rest_rate):
        return float("nan")
    return degrees_from_radians(float(np.abs(np.mean(verification.rest_rate, axis=0)).max()))
