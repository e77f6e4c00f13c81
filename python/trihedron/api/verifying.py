"""Verify one calibration, or rank several of any program, on a recording that they were not made from."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.api.applying import (
    AnyCalibration,
    calibration_of,
    check_range,
    check_units,
    doubted,
    without_effects,
)
from trihedron.api.calibrating import calibrate
from trihedron.api.choices import gravity_of, settle_gravity
from trihedron.api.reading import AnyRecording, recording_of, segments_of
from trihedron.arrays import AXES, rms_of
from trihedron.errors import INPUT_ERRORS, InputError
from trihedron.estimate.ranking import densities, rms_interval, suspicions_of, with_bias_of_log
from trihedron.estimate.verification import verify_calibration
from trihedron.files.formats import any_calibration
from trihedron.files.formats.boards import as_logged
from trihedron.records import Calibration, Finding, Recording, Segments, Severity, Verification
from trihedron.records.progress import Progress
from trihedron.records.ranking import Ranked, Ranking
from trihedron.records.results import VerificationResult
from trihedron.segment import averaged
from trihedron.units import AccelerationUnit, RateUnit, acceleration_to_si, mg_from_m_s2, rate_to_si


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
    gravity_m_s2 or latitude_deg, height_m : float; that of the calibration unless given
    limit_mg, limit_deg : float, optional
        Largest acceptable rms gravity error [mg] and tilt error [°]: beyond one there is a serious finding. Without
        a limit, errors above ten times those expected are serious; within a limit they are a warning (the gyro's
        rate in static poses, within that of tilt).
    progress : callable, called with the share done (0 to 1) and what is being done

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
    is_tilt_limited = limit_deg is not None
    accepted = {
        "residual-above-noise": limit_mg is not None,
        "held-out-worse": is_tilt_limited,
        "static-rate-above-noise": is_tilt_limited,
    }
    missed = tuple(
        replace(found, severity=Severity.WARNING) if accepted.get(found.code, False) else found
        for found in judged.findings
    )
    findings = (*recording.findings, *segments.findings, *missed, *more, *_limits(judged, limit_mg, limit_deg))
    findings = (*same_recording(known, recording), *doubted(known), *_range(known, recording), *changed, *findings)
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


def _range(known: Calibration, recording: Recording) -> Iterator[Finding]:
    """Whether the log's temperature is one that the calibration is valid for: a warning, as the errors are measured."""
    return (replace(found, severity=Severity.WARNING) for found in check_range(known, recording))


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


def same_recording(known: Calibration, recording: Recording) -> tuple[Finding, ...]:
    """A finding where a calibration is tested on the log, or on one of several, that it was made from."""
    sessions: Any = known.extensions.get("sessions", ())
    made_from = {known.recording_sha256, *(one.get("sha256") for one in sessions)}
    is_same = bool(recording.sha256) and recording.sha256 in made_from
    # One of the two files of a recording has a hash of its own.
    groups = [known.recording_source, *(one.get("group", "") for one in sessions)]
    is_half = any(" + " in group and recording.source in group.split(" + ") for group in groups)
    return (Finding.of("same-recording"),) if is_same or is_half else ()


def rank(
    calibrations: Sequence[AnyCalibration],
    recording: AnyRecording,
    *,
    segments: Segments | None = None,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
    progress: Progress | None = None,
) -> Ranking:
    """Calibrations of one unit, from trihedron or any other program, in the order in which they fit a recording.

    Each is judged by gravity in static poses, tilt after rotations and the static rate, and ranked by log predictive
    density. For one that does not fit, a likely mistake is named, with which corrected it fits: the sign or unit of a
    bias, the direction of a matrix, its axes, the gravity it was made with.

    Parameters
    ----------
    calibrations : sequence of calibration, result or path
    recording : Recording, or what trihedron.read takes
    gravity_m_s2 or latitude_deg, height_m : float; by default that of the trihedron calibrations
    segments : Segments, found when not given
    progress : callable, called with the share done (0 to 1) and what is being done

    Returns
    -------
    Ranking
        ``candidates``, the best first, each with verification, intervals and suspected mistakes; ``print`` shows it.

    Raises
    ------
    ValueError
        When fewer than two calibrations are given, units differ, or the recording has no pose.

    Examples
    --------
    >>> len(trihedron.rank([result, result], recording).candidates)
    2
    """
    if len(calibrations) < 2:
        raise InputError("a ranking needs two calibrations at least; one is judged by `trihedron verify`.")
    recording = recording_of(recording, latitude_deg)
    named = [(_name(given, k), _read(given)) for k, given in enumerate(calibrations)]
    stated = [known.gravity_m_s2 for _, known in named if "maker" not in known.extensions]
    of_files = (float(np.median(stated)), "that of the calibrations") if stated else None
    gravity, source, _ = settle_gravity(gravity_m_s2, latitude_deg, height_m, of_files)
    segments = segments_of(segments, recording, progress)
    own = own_calibration(recording, segments, gravity)
    judged = []
    for name, known in named:
        known = _on_this_log(known, recording)
        if not known.extensions.get("effects"):
            known = with_bias_of_log(known, segments, gravity)
        judged.append((name, known, _judge(known, recording, segments, gravity, source, own)))
    points = densities([verification for _, _, verification in judged])
    out = [
        Ranked(
            name=name,
            maker=str(known.extensions.get("maker", "trihedron")),
            verification=verification,
            behind=0.0,
            behind_sigma=0.0,
            norm_interval=rms_interval(verification.norm_error),
            angle_interval=rms_interval(verification.angle_deg),
            suspicions=() if own is None else suspicions_of(known, own, recording, segments, gravity),
            without_bias=tuple(known.extensions.get("without_bias", ())),  # type: ignore[arg-type]
        )
        for name, known, verification in judged
    ]
    # A rejected calibration is not the best, however well it fits: it may have been made from this very log.
    best = points[min(range(len(out)), key=lambda k: (out[k].is_rejected, -points[k].sum()))]
    lost = [best - own_points for own_points in points]
    out = [
        replace(one, behind=float(by.sum()), behind_sigma=float(np.sqrt(len(by)) * by.std()))
        for one, by in zip(out, lost, strict=True)
    ]
    ordered = sorted(out, key=lambda one: (one.is_rejected, one.behind))
    return Ranking(recording.source, gravity, source, tuple(ordered))


def _judge(
    known: Calibration,
    recording: Recording,
    segments: Segments,
    gravity_m_s2: float,
    source: str,
    own: Calibration | None,
) -> Verification:
    check_units(known, recording)
    linear, more = without_effects(known, recording)
    if linear is not recording:
        # The same poses as those of the other calibrations, of the readings for which S and b are valid.
        recording, segments = linear, averaged(linear, segments)
        known = with_bias_of_log(known, segments, gravity_m_s2)
        own = own_calibration(recording, segments, gravity_m_s2)
    judged = verify_calibration(known, recording, segments, gravity_m_s2, source, own)
    findings = (*_range(known, recording), *recording.findings, *segments.findings, *judged.findings, *more)
    return replace(judged, findings=(*same_recording(known, recording), *doubted(known), *findings))


def _on_this_log(known: Calibration, recording: Recording) -> Calibration:
    """A calibration of another program in the units of the log, composed with the board's own corrections."""
    if "maker" not in known.extensions:
        return known
    known = as_logged(known, recording.onboard)
    accel, gyro = known.accelerometer, known.gyroscope
    to, of = acceleration_to_si(recording.accelerometer_unit), acceleration_to_si(AccelerationUnit(accel.raw_unit))
    if to is not None and of is not None:
        accel = replace(accel, S=accel.S * (to / of), raw_unit=recording.accelerometer_unit.value)
    if gyro is not None:
        to, of = rate_to_si(recording.gyroscope_unit), rate_to_si(RateUnit(gyro.raw_unit))
        if to is not None and of is not None:
            gyro = replace(gyro, S=gyro.S * (to / of), raw_unit=recording.gyroscope_unit.value)
    return replace(known, accelerometer=accel, gyroscope=gyro)


def _read(given: AnyCalibration) -> Calibration:
    return any_calibration(given) if isinstance(given, str | os.PathLike) else calibration_of(given)


def _name(given: AnyCalibration, k: int) -> str:
    return Path(given).name if isinstance(given, str | os.PathLike) else f"calibration {k + 1}"
