"""Verify a calibration on a recording that it was not made from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from trihedron.api.applying import AnyCalibration, calibration_of, check_units, doubted, without_effects
from trihedron.api.calibrating import calibrate
from trihedron.api.choices import gravity_of, settle_gravity
from trihedron.api.reading import AnyRecording, recording_of, segments_of
from trihedron.arrays import AXES, rms_of
from trihedron.errors import INPUT_ERRORS
from trihedron.estimate.verification import verify_calibration
from trihedron.records import Calibration, Finding, Progress, Recording, Segments, Severity, Verification
from trihedron.records.results import VerificationResult
from trihedron.thermal_model import check_range
from trihedron.units import mg_from_m_s2


def verify(
    calibration: AnyCalibration,
    recording: AnyRecording,
    *,
    segments: Segments | None = None,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
    limit_mg: float | None = None,
    limit_deg: float | None = None,
    progress: Progress | None = None,
) -> VerificationResult:
    """Gravity error in static poses and tilt error after rotations, in a recording that the calibration has not seen.

    Parameters
    ----------
    calibration : result of a calibration, Calibration or file
        What to test.
    recording : Recording, or what trihedron.read takes
        A session that the calibration was not made from.
    segments : Segments, found when not given
    gravity_m_s2 or latitude_deg, height_m : float
        That of the calibration unless given.
    limit_mg, limit_deg : float, optional
        Largest acceptable rms gravity error [mg] and tilt error [°]: beyond one there is a serious finding. Without
        a limit, errors above ten times those expected are serious; within a limit they are a warning (the gyro's
        rate in static poses, within that of tilt).
    progress : callable(share done from 0 to 1, what is being done)

    Returns
    -------
    VerificationResult
        ``is_passed``, errors with their expected size, and ``findings``.

    Raises
    ------
    ValueError
        When units differ, or the recording has no accelerometer or no pose.

    Examples
    --------
    >>> another, _ = trihedron.simulate("hand-session", 4)
    >>> trihedron.verify(result, another).is_passed
    True
    """
    known = calibration_of(calibration)
    changed = [one for one in known.findings if one.code == "bias-drift"]
    recording = recording_of(recording, latitude_deg)
    check_units(known, recording)
    linear, more = without_effects(known, recording)
    recording, segments = linear, segments if linear is recording else None
    segments = segments_of(segments, recording, progress)
    gravity, source, _ = settle_gravity(gravity_m_s2, latitude_deg, height_m, gravity_of(known))
    own = own_calibration(recording, segments, gravity)
    judged = verify_calibration(_with_drifts(known, changed), recording, segments, gravity, source, own)
    limits = {"residual-above-noise": limit_mg, "held-out-worse": limit_deg, "static-rate-above-noise": limit_deg}
    missed = tuple(
        found if limits.get(found.code) is None else replace(found, severity=Severity.WARNING)
        for found in judged.findings
    )
    missed = (*changed, *missed, *more, *_limits(judged, limit_mg, limit_deg))
    findings = on_log(known, recording, segments, missed)
    return VerificationResult(replace(judged, findings=findings), known, segments, recording)


def _with_drifts(known: Calibration, changed: list[Finding]) -> Calibration:
    """The calibration with what its biases changed by in its own recording: another one is anywhere on the way."""
    covariance = known.covariance.copy()
    for one in changed:
        change = np.array([one.numbers[f"change_{axis}"] for axis in AXES])
        first = 21 if one.numbers["is_gyro"] else 9
        covariance[first : first + 3, first : first + 3] += np.diag(change**2 / 12.0)
    gyroscope = known.gyroscope
    return replace(
        known,
        accelerometer=replace(known.accelerometer, covariance=covariance[:12, :12]),
        gyroscope=None if gyroscope is None else replace(gyroscope, covariance=covariance[12:, 12:]),
        covariance=covariance,
    )


def own_calibration(recording: Recording, segments: Segments, gravity_m_s2: float) -> Calibration | None:
    """The recording's own calibration; ``None`` where it does not determine one."""
    try:
        return calibrate(recording, segments=segments, gravity_m_s2=gravity_m_s2).calibration
    except INPUT_ERRORS:
        return None


def on_log(
    known: Calibration, recording: Recording, segments: Segments, judged: tuple[Finding, ...]
) -> tuple[Finding, ...]:
    """All findings on a calibration on a log: a temperature outside its range is a warning, as errors are measured."""
    outside = (replace(found, severity=Severity.WARNING) for found in check_range(known, recording))
    of_log = (*recording.findings, *segments.findings)
    return (*_same_recording(known, recording), *doubted(known), *outside, *of_log, *judged)


def _limits(judged: Verification, limit_mg: float | None, limit_deg: float | None) -> tuple[Finding, ...]:
    found = []
    rms_m_s2, rms_deg = judged.norm_rms, judged.angle_rms_deg
    if limit_mg is not None and not mg_from_m_s2(rms_m_s2) <= limit_mg:
        is_below = mg_from_m_s2(rms_of(judged.norm_noise)) > limit_mg
        found.append(
            Finding.of("limit-exceeded", "static", rms_m_s2=rms_m_s2, limit_mg=limit_mg, is_below_noise=is_below)
        )
    if limit_deg is not None and not rms_deg <= limit_deg:
        is_below = rms_of(judged.angle_noise_deg) > limit_deg
        found.append(
            Finding.of("limit-exceeded", "moves", rms_deg=rms_deg, limit_deg=limit_deg, is_below_noise=is_below)
        )
    return tuple(found)


def _same_recording(known: Calibration, recording: Recording) -> tuple[Finding, ...]:
    """A finding where a calibration is tested on the log, or on one of several, that it was made from."""
    sessions: Any = known.extensions.get("sessions", ())
    made_from = {known.recording_sha256, *(one.get("sha256") for one in sessions)}
    is_same = bool(recording.sha256) and recording.sha256 in made_from
    # One of the two files of a recording has a hash of its own.
    groups = [known.recording_source, *(one.get("group", "") for one in sessions)]
    is_half = any(" + " in group and recording.source in group.split(" + ") for group in groups)
    return (Finding.of("same-recording"),) if is_same or is_half else ()
