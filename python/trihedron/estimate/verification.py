"""A calibration against another recording: gravity error in static poses, tilt error after rotations, static rate."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from trihedron import probability
from trihedron.arrays import FloatArray, IntArray, rms_of
from trihedron.errors import InputError
from trihedron.estimate.gravity_error import norm_error
from trihedron.estimate.gyroscope.measurements import MoveMeasurements, measure_moves
from trihedron.estimate.session.carried import carried_by, without_g_sensitivity
from trihedron.estimate.verified_parameters import (
    common_factor,
    imprecision_findings,
    judge_parameters,
    shift_findings,
    shifted_parameters,
    uncalibrated,
)
from trihedron.estimate.verified_static_rate import bias_findings, expected_change, rate_findings, static_rate
from trihedron.gravity import earth_rate_up, turned_with_earth
from trihedron.records import (
    Calibration,
    Finding,
    Recording,
    Segments,
    SensorCalibration,
    Severity,
    Verification,
)
from trihedron.records.verification import JudgedParameter
from trihedron.transforms import directions_of

FAR_BEYOND = 10.0
"""Ratio of an error to noise and stated uncertainty above which the calibration is not, or no longer, this sensor's.
Other sessions of one unit reach 0.5 to 3 in poses, 2 to 9 after moves, 1 to 3 in static rates (kim, mimu4444, phone),
another unit 8 to 60 in poses and moves.
"""
FEW = 2
"""Parameters that may have changed alone; gravity or a unit that is wrong changes the scale of three axes."""


def verify_calibration(
    calibration: Calibration,
    recording: Recording,
    segments: Segments,
    gravity_m_s2: float,
    gravity_source: str,
    own: Calibration | None = None,
) -> Verification:
    """Judge a calibration by the poses (docs/model.md, 10) and moves (equation 5.1) of another recording; no fit.

    Parameters are compared with ``own``, the calibration of that recording; without it only the gyro bias is. Raises
    ``InputError`` when the recording has no accelerometer or no pose.
    """
    if recording.accelerometer is None or segments.accelerometer_mean is None:
        raise InputError("verification needs the accelerometer: gravity is what a calibration is tested against")
    if segments.n_poses == 0:
        raise InputError("verification needs poses, and none was found: keep the sensor still for some seconds")
    accelerometer = calibration.accelerometer
    noise = _variance(segments.norm_sigma, segments.n_poses)
    error, error_noise, error_sigma = norm_error(accelerometer, segments.accelerometer_mean, noise, gravity_m_s2)
    gyroscope, measured = calibration.gyroscope, None
    angle_deg = angle_noise_deg = angle_sigma_deg = np.zeros(0)
    force = segments.accelerometer_mean @ accelerometer.S.T + accelerometer.b
    rest, rest_noise = static_rate(gyroscope, segments)
    rest_sigma = expected_change(calibration, recording, segments, rest_noise)
    if gyroscope is not None and len(rest):
        rest = rest - earth_rate_up(recording.latitude_deg) / gravity_m_s2 * force
        earth = turned_with_earth(recording.latitude_deg, directions_of(force))
        rest_sigma = np.sqrt(rest_sigma**2 + np.einsum("nii->ni", earth))
        if any(move.stop - move.start >= 2 for move in segments.moves):
            measured = without_g_sensitivity(measure_moves(recording, segments, accelerometer), own)
            angle_deg, angle_noise_deg, angle_sigma_deg = _carried(calibration, gyroscope, measured, segments)
    lost = np.zeros(0, dtype=np.bool_) if measured is None else measured.is_lost
    parameters = judge_parameters(calibration, own, segments)
    without = uncalibrated(calibration, own, recording)
    changed = _changed(parameters)
    judged = (calibration, without, measured, segments)
    worse = _worse_than_none(*judged, gravity_m_s2, (error, angle_deg), changed)
    of_poses = _norm_findings(error, error_sigma, gravity_m_s2, changed)
    of_rates = tuple(rate_findings(rest, rest_sigma, own, FAR_BEYOND))
    of_moves = _angle_findings(angle_deg, angle_sigma_deg, np.flatnonzero(~lost), changed, segments)
    beyond_noise = (*of_poses, *of_moves)
    return Verification(
        source=recording.source,
        sha256=recording.sha256,
        calibration_source=calibration.recording_source,
        gravity_m_s2=gravity_m_s2,
        gravity_source=gravity_source,
        norm_error=error,
        norm_noise=error_noise,
        norm_sigma=error_sigma,
        angle_deg=angle_deg,
        angle_noise_deg=angle_noise_deg,
        angle_sigma_deg=angle_sigma_deg,
        static_rate=rest,
        static_rate_sigma=rest_sigma,
        moves=np.flatnonzero(~lost),
        moves_left_out=tuple(np.flatnonzero(lost).tolist()),
        parameters=parameters,
        findings=(
            *beyond_noise,
            *of_rates,
            *worse,
            *bias_findings(gyroscope, rest, FAR_BEYOND, is_alone=not beyond_noise),
            *shift_findings(parameters),
            *_untested(calibration, own, segments),
            *(() if beyond_noise else imprecision_findings(error, angle_deg, own)),
        ),
    )


def _untested(calibration: Calibration, own: Calibration | None, segments: Segments) -> Iterator[Finding]:
    """Finding where the log does not determine a sensor by itself: an error of the file may not show in it."""
    determined = {
        name
        for name, sensor in (() if own is None else own.sensors)
        if sensor.observability is not None and sensor.observability.rank >= sensor.observability.n_parameters
    }
    sensors = [name for name, _ in calibration.sensors if name not in determined]
    if sensors:
        poses, moves = segments.n_poses, len(segments.moves)
        yield Finding.of("not-tested", sensors=sensors, poses=poses, moves=moves)


class _Changed(NamedTuple):
    """What differs from the calibration of the log itself: whether biases alone, a few parameters, by name, or
    all gyro scales by one factor."""

    is_bias: bool
    is_few: bool
    shifted: list[str]
    gyro_factor: float | None


def _changed(parameters: tuple[JudgedParameter, ...]) -> _Changed:
    shifted = shifted_parameters(parameters)
    ids = {one.id for one in shifted}
    is_bias = "accel-bias" in ids <= {"accel-bias", "gyro-bias"}
    factor = common_factor(parameters, "gyro-scale") if "gyro-scale" in ids <= {"gyro-scale", "gyro-bias"} else None
    return _Changed(is_bias, 0 < len(shifted) <= FEW, [f"{one.id}-{one.name}" for one in shifted[:FEW]], factor)


def _worse_than_none(
    calibration: Calibration,
    without: Calibration,
    measured: MoveMeasurements | None,
    segments: Segments,
    gravity_m_s2: float,
    errors: tuple[FloatArray, FloatArray],
    changed: _Changed,
) -> list[Finding]:
    """Findings where readings scaled by their unit alone have smaller errors, whatever uncertainty the file states."""
    error, angle = errors
    assert segments.accelerometer_mean is not None
    noise = _variance(segments.norm_sigma, segments.n_poses)
    bare, _, _ = norm_error(without.accelerometer, segments.accelerometer_mean, noise, gravity_m_s2)
    pairs = {"static": (error, bare)}
    gyroscope = without.gyroscope
    if gyroscope is not None and measured is not None:
        with_it = replace(calibration, gyroscope=gyroscope)
        pairs["moves"] = (angle, _carried(with_it, gyroscope, measured, segments)[0])
    return [
        Finding.of(
            "worse-than-uncalibrated",
            f"verify-{case}",
            rms=rms_of(with_it),
            rms_without=rms_of(bare),
            is_few=changed.is_few,
            shifted=changed.shifted,
            is_common=changed.gyro_factor is not None,
            common=changed.gyro_factor or 0.0,
        )
        for case, (with_it, bare) in pairs.items()
        if _is_larger(with_it, bare)
    ]


def reference_findings(calibration: Calibration, recording: Recording, segments: Segments) -> Iterator[Finding]:
    """Finding where a calibration by a reference leaves the static poses of its own log no smaller gravity error."""
    means, gravity = segments.accelerometer_mean, calibration.gravity_m_s2
    if means is None or not len(means):
        return
    noise, without = _variance(segments.norm_sigma, segments.n_poses), uncalibrated(calibration, None, recording)
    error, _, sigma = norm_error(calibration.accelerometer, means, noise, gravity)
    bare, _, _ = norm_error(without.accelerometer, means, noise, gravity)
    if rms_of(error) >= rms_of(bare):
        yield Finding.of(
            "worse-than-uncalibrated",
            "reference",
            rms_m_s2=rms_of(error),
            rms_without_m_s2=rms_of(bare),
            expected_m_s2=rms_of(sigma),
        )


def _is_larger(errors: FloatArray, others: FloatArray) -> bool:
    """Whether squared errors (n,) or (n, k) exceed ``others`` of the same poses or moves: paired one-sided t test."""
    more = errors**2 - others**2
    more = more if more.ndim == 1 else more.sum(axis=1)
    n = len(more)
    if n < 3:
        return False
    limit = float(probability.stdtrit(n - 1, 1.0 - probability.FALSE_ALARM))
    return bool(more.mean() > limit * more.std(ddof=1) / np.sqrt(n))


def _variance(sigma: FloatArray | None, n: int) -> FloatArray:
    return np.zeros((n, 3)) if sigma is None else np.asarray(sigma) ** 2


def _carried(
    calibration: Calibration, gyroscope: SensorCalibration, measured: MoveMeasurements, segments: Segments
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Tilt errors (m,) [deg] after rotations as in a calibration's report (docs/model-session.md), their noise, and
    noise with the calibration's uncertainty: S of the calibration, a bias per pose, without moves that were at the
    gyro's range limit for long."""
    seen = carried_by(calibration, gyroscope.S, measured, segments)
    told = ~measured.is_lost
    by_calibration2 = seen.by_calibration2(calibration.covariance)
    variances = seen.floor2, seen.floor2 + by_calibration2
    noise, total = (np.degrees(np.sqrt(of[told]) / calibration.gravity_m_s2) for of in variances)
    return seen.angle_deg[told], noise, total


def _norm_findings(error: FloatArray, sigma: FloatArray, gravity_m_s2: float, changed: _Changed) -> Iterator[Finding]:
    """Finding where gravity errors exceed what is expected, with what differs from the log's own calibration."""
    beyond = _beyond((error / sigma) ** 2, 1)
    if beyond is None:
        return
    worst = int(np.argmax(np.abs(error / sigma)))
    n_same, mean = int(max(np.sum(error > 0.0), np.sum(error < 0.0))), float(np.mean(error))
    yield Finding.of(
        "residual-above-noise",
        "verify-static",
        norm_rms_m_s2=rms_of(error),
        is_bias=changed.is_bias,
        is_few=changed.is_few,
        shifted=changed.shifted,
        # Sign test: the errors of single poses have either sign.
        is_offset=2.0 * probability.bdtrc(n_same - 1, len(error), 0.5) < probability.FALSE_ALARM,
        n_same=n_same,
        n_poses=len(error),
        mean_m_s2=mean,
        share=abs(mean) / gravity_m_s2,
        worst_pose=worst + 1,
        is_first=worst == 0,
        worst_m_s2=error[worst],
        severity=Severity.SERIOUS if beyond.is_far else Severity.WARNING,
        times=beyond.times,
        is_far=beyond.is_far,
        is_single=beyond.is_single,
        chi2_per_dof=beyond.times**2,
    )


class _Beyond(NamedTuple):
    """Errors in times their expected size, whether that is far, and whether the largest alone exceeds it."""

    times: float
    is_far: bool
    is_single: bool


def _beyond(z2: FloatArray, n_components: int) -> _Beyond | None:
    """Squared errors (n,) of ``n_components`` each, in their expected size; ``None`` where they are as expected."""
    if probability.chdtrc(n_components * len(z2), float(z2.sum())) > probability.FALSE_ALARM:
        return None
    times = float(np.sqrt(np.mean(z2) / n_components))
    others = probability.chdtrc(n_components * (len(z2) - 1), float(z2.sum() - z2.max())) if len(z2) > 1 else 0.0
    return _Beyond(times, times > FAR_BEYOND, others > probability.FALSE_ALARM)


def _angle_findings(
    angle_deg: FloatArray, sigma_deg: FloatArray, which: IntArray, changed: _Changed, segments: Segments
) -> Iterator[Finding]:
    """Finding where tilt errors (m,) after the moves ``which`` (m,) exceed what is expected."""
    if not len(angle_deg):
        return
    # Two components per move share the variance sigma², so the squared ratio has mean one and two degrees of freedom.
    beyond = _beyond(2.0 * (angle_deg / sigma_deg) ** 2, 2)
    if beyond is None:
        return
    worst = int(np.argmax(angle_deg / sigma_deg))
    move = segments.moves[which[worst]]
    unsteady = [k + 1 for k in (move.pose_before, move.pose_after) if segments.poses[k].is_unsteady]
    yield Finding.of(
        "held-out-worse",
        "verify-moves",
        angle_rms_deg=rms_of(angle_deg),
        is_bias=changed.is_bias,
        is_few=changed.is_few,
        shifted=changed.shifted,
        worst_move=int(which[worst]) + 1,
        worst_deg=angle_deg[worst],
        is_common=changed.gyro_factor is not None,
        common=changed.gyro_factor or 0.0,
        is_beside=bool(unsteady),
        unsteady=unsteady,
        severity=Severity.SERIOUS if beyond.is_far else Severity.WARNING,
        times=beyond.times,
        is_far=beyond.is_far,
        is_single=beyond.is_single,
        chi2_per_dof=beyond.times**2,
    )
