"""The calibrated rate in static poses, whose truth is 0: the change of the bias, and what it does from pose to pose."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from trihedron import _core, probability
from trihedron.arrays import AXES, FloatArray, rms_of
from trihedron.records import Calibration, Finding, Recording, Segments, SensorCalibration, Severity
from trihedron.session.drift import TYPICAL
from trihedron.session.noise import FEWEST_POSES, NOISE_CORNER_S, NOISE_DOF


def static_rate(gyroscope: SensorCalibration | None, segments: Segments) -> tuple[FloatArray, FloatArray]:
    """Rate of every pose [rad/s] (n, 3) with its standard error by noise; (0, 3) without a gyro."""
    mean, sigma = segments.gyroscope_mean, segments.gyroscope_sigma_mean
    if gyroscope is None or mean is None:
        return np.zeros((0, 3)), np.zeros((0, 3))
    noise = np.zeros_like(mean) if sigma is None else np.sqrt(sigma**2 @ (gyroscope.S**2).T)
    return mean @ gyroscope.S.T + gyroscope.b, noise


def with_static_rate(calibration: Calibration, segments: Segments) -> Calibration:
    """The calibration with the rate that its one bias leaves in the poses of its own log: the others predict each."""
    gyro, n = calibration.gyroscope, segments.n_poses
    rate, noise = static_rate(gyro, segments)
    if gyro is None or gyro.quality is None or len(rate) < 3 or not np.isfinite(rate).all():
        return calibration
    rms = rms_of(rate - rate.mean(axis=0)) * n / (n - 1)
    quality = replace(gyro.quality, static_rate_rms=rms, static_rate_floor=rms_of(noise))
    return replace(calibration, gyroscope=replace(gyro, quality=quality))


def expected_change(known: Calibration, recording: Recording, segments: Segments, noise: FloatArray) -> FloatArray:
    """Standard deviation (n, 3) of every pose's rate about the session's bias: the noise of the mean, flicker and a
    random walk as strong as noise explains (docs/model-session.md, 11.12d), the change that the calibration states.

    Its σ of b, common to all poses, is no part of it.
    """
    gyro = known.gyroscope
    if gyro is None or recording.gyroscope is None or not len(noise):
        return noise
    spans = segments.spans
    scale = float(np.cbrt(abs(np.linalg.det(gyro.S))))
    variance = noise**2 + (scale * _core.flicker_scatter(recording.gyroscope, spans, None, FEWEST_POSES)) ** 2
    if segments.gyroscope_sigma is not None:
        density2 = (np.asarray(segments.gyroscope_sigma) ** 2 @ (gyro.S**2).T) / recording.rate_hz
        # White noise and walk have equal Allan variance at the corner; a walk of length T is T/6 about its mean.
        variance = variance + 3.0 * density2 / NOISE_CORNER_S**2 * float(np.ptp(segments.time_mid_s)) / 6.0
    return np.asarray(np.sqrt(variance + _stated_change(known) ** 2 / 12.0))


def _stated_change(known: Calibration) -> float:
    """How far the gyro's bias changed in the recording of the calibration [rad/s], on the worst axis."""
    changes = [one.numbers["change_rad_s"] for one in known.findings if one.code == "gyro-bias-drift"]
    for one in known.findings:
        if one.code == "bias-drift" and one.numbers["is_gyro"]:
            changes += [one.numbers[f"change_{axis}"] for axis in AXES]
    return max(changes, default=0.0)


def bias_findings(
    gyroscope: SensorCalibration | None, rest: FloatArray, far: float, *, is_alone: bool
) -> Iterator[Finding]:
    """Finding where the gyro bias differs by more than ``far`` σ of its repeatability: the change of typical parts,
    the poses' scatter and the stated uncertainty. ``is_alone``: poses and moves agree.

    Up to there it is what a switched-on gyro does: its change is stated among the parameters (``shift_findings``).
    """
    if gyroscope is None or len(rest) < 2:
        return
    sigma = float(np.sqrt(np.mean(np.var(rest, axis=0, ddof=1)) + np.mean(gyroscope.sigma_b**2) + TYPICAL[1] ** 2))
    shift = rms_of(np.mean(rest, axis=0))
    if shift > far * sigma:
        yield Finding.of(
            "calibration-shift",
            "gyro-bias",
            rate_rad_s=shift,
            times_expected=shift / sigma,
            sigma_rad_s=sigma,
            is_alone=is_alone,
        )


def rate_findings(rest: FloatArray, sigma: FloatArray, own: Calibration | None, far: float) -> Iterator[Finding]:
    """Finding where rates (n, 3) change from pose to pose by more than is expected, serious above ``far`` times, and
    whether the ``own`` calibration of the recording shows them to follow the specific force."""
    if len(rest) < 3 or not (sigma > 0.0).all():
        return
    away, dof = rest - rest.mean(axis=0), 3.0 * (len(rest) - 1)
    chi2_per_dof = float(np.sum((away / sigma) ** 2)) / dof
    if probability.fdtrc(dof, NOISE_DOF, chi2_per_dof) > probability.FALSE_ALARM:
        return
    seen = [] if own is None else [f for f in own.findings if f.code == "gyro-g-sensitivity"]
    pose, axis = np.unravel_index(int(np.argmax(np.abs(away))), away.shape)
    yield Finding.of(
        "static-rate-above-noise",
        severity=Severity.SERIOUS if chi2_per_dof > far**2 else Severity.WARNING,
        rate_rms_rad_s=rms_of(away),
        times=np.sqrt(chi2_per_dof),
        chi2_per_dof=chi2_per_dof,
        worst_pose=int(pose) + 1,
        axis=int(axis) + 1,
        worst_rad_s=float(away[pose, axis]),
        is_by_gravity=bool(seen),
        per_g_rad_s=seen[0].numbers["per_g_rad_s"] if seen else 0.0,
    )
