"""Calibrate both sensors from poses and moves, with uncertainties."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

from trihedron.api.calibrating_methods import METHODS, Found, LogOfPoses, Method, on_turns
from trihedron.api.choices import settle_gravity
from trihedron.api.reading import AnyRecording, recording_of, require_poses, segments_of
from trihedron.errors import InputError
from trihedron.estimate.accelerometer.nonlinear_shapes import with_shapes
from trihedron.estimate.gyroscope.common_scale import scale_findings, without_first_scale
from trihedron.estimate.gyroscope.lost_samples import missing_samples, relative_sigma
from trihedron.estimate.gyroscope.turntable import on_turntable
from trihedron.estimate.verification import reference_findings
from trihedron.estimate.verified_static_rate import with_static_rate
from trihedron.records import Calibration, Frame, Progress, Recording, Segments, Severity
from trihedron.records.plain import as_plain
from trihedron.records.results import CalibrationResult
from trihedron.sensor_model import in_frame

if TYPE_CHECKING:
    from trihedron.api.referring import AnyReference


def calibrate(
    recording: AnyRecording,
    *,
    segments: Segments | None = None,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
    method: Method = "joint",
    frame: Frame | None = None,
    faces: Sequence[int] | None = None,
    turns_deg: Sequence[float] | None = None,
    axis_signs: Sequence[int] | None = None,
    gyroscope_nominal: float | None = None,
    turntable_deg_s: Sequence[float] | None = None,
    turntable_sigma: float = 0.0,
    reference: AnyReference | None = None,
    reference_columns: str | None = None,
    progress: Progress | None = None,
) -> CalibrationResult:
    """Calibrate both sensors from one recording of static poses and moves.

    Parameters
    ----------
    recording : Recording, or what trihedron.read takes
        Without a gyro the accelerometer is calibrated alone.
    segments : Segments, found when not given
    gravity_m_s2 or latitude_deg, height_m : float
        |g| at the place. Without it 9.80665 m/s² is used, and a finding states the possible error.
    method : "joint", "separate" or "faces"
        Any poses, both sensors in one fit (default) or one after the other; or faces of a square case and known turns.
    frame : "lower", "symmetric" or "case"
        Body frame: ``case`` by default with faces, else ``lower`` (triangular, X along accelerometer X).
    faces : sequence of ±1, ±2, ±3 or 0
        With ``"faces"``: the axis of the case that points up in every pose; 0 excludes a pose.
    turns_deg : sequence of float
        Angle [°] of every turn on a table, about the axis that points up, between poses of the same tilt; 0 excludes a
        turn. With ``"faces"`` multiples of 90° are recognised where the scale is known.
    axis_signs : three of ±1
        Sign of each raw axis along its axis of the body, from the board's documentation; not with ``"faces"``.
    gyroscope_nominal : float
        Nominal scale [rad/s per raw unit], for counts where too few moves determine it.
    turntable_deg_s : sequence of float
        Speed of a turntable [°/s], the unit in any orientation: one for all steady turns, or one each; 0 excludes one.
    turntable_sigma : float
        Relative standard error of the table's speed, common to all turns.
    reference : path, Recording or ReferenceMotion
        Known motion beside the log (rate table, optical tracking, another unit): both sensors are calibrated by it, and
        static poses are not needed.
    reference_columns : str
        Its columns where names do not state them.
    progress : callable(share done from 0 to 1, what is being done)

    Returns
    -------
    CalibrationResult
        ``accelerometer``, ``gyroscope`` (None without one), each with ``S`` (3, 3) [SI per raw unit], ``b`` (3,) [SI],
        ``sigma_S``, ``sigma_b``, ``covariance`` (12, 12); ``findings``, ``segments``. ``print`` shows the report.

    Raises
    ------
    ValueError
        When the log does not determine a calibration or an argument is wrong; one sentence says why and what to do.

    Examples
    --------
    >>> result = trihedron.calibrate(recording, latitude_deg=59.94)
    >>> result.accelerometer.S.shape
    (3, 3)
    >>> result.is_trustworthy
    True
    """
    if method not in METHODS:
        raise InputError(f"there is no method {method!r}; choose one of {', '.join(METHODS)}.")
    gravity, source, said = settle_gravity(gravity_m_s2, latitude_deg, height_m)
    recording = recording_of(recording, latitude_deg)
    segments = segments_of(segments, recording, progress)
    if reference is not None:
        from trihedron.api.referring import calibration_by, held_against

        if turntable_deg_s is not None:
            raise InputError("a turntable's speeds belong to poses and moves: leave them, or the reference, out.")
        found = held_against(recording, reference, gravity, columns=reference_columns)
        by_motion = calibration_by(found, recording, gravity, source, frame)
        is_fitted = found.accelerometer is not None
        said = (*said, *reference_findings(by_motion, recording, segments)) if is_fitted else ()
        return replace(_result(by_motion, (*said, *by_motion.findings), segments, recording), reference=found)
    require_poses(recording, segments)
    log = LogOfPoses(recording, segments, gravity, source, gyroscope_nominal)
    if method == "faces":
        calibration = log.by_faces(faces, turns_deg)
        wanted: Frame = frame or "case"
    else:
        if faces is not None:
            raise InputError(f"faces belong to method 1: say --method faces, or leave them out of {method}.")
        wanted = frame or "lower"
        try:
            calibration = log.by_poses(method, axis_signs)
        except InputError as error:
            # Serious findings about the log come before the error of the fit.
            grave = [f"{one.seen} {one.action}" for one in recording.findings if one.severity is Severity.SERIOUS]
            raise InputError(" ".join((*grave, *(["As it is:"] if grave else []), str(error)))) from None
    calibration = in_frame(calibration, wanted)
    if turns_deg is not None and method != "faces" and calibration.gyroscope is not None:
        calibration = on_turns(calibration, recording, segments, turns_deg)[0]
    if turntable_deg_s is not None or turntable_sigma != 0.0:
        calibration = on_turntable(calibration, recording, segments, turntable_deg_s, turntable_sigma)
    of_fit = _of_fit(calibration, recording, segments)
    findings = (*said, *without_first_scale(recording.findings, of_fit), *segments.findings, *of_fit)
    calibration = with_static_rate(calibration, segments)
    return _result(calibration, _with_doubtful_columns(findings), segments, recording)


def _with_doubtful_columns(findings: Found) -> Found:
    """The findings, with columns that were guessed as serious as poses that do not determine a calibration: another
    sensor's readings look like that."""
    if not any(one.severity is Severity.SERIOUS and one.code == "not-observable" for one in findings):
        return findings
    is_guess = ("columns-assumed", Severity.WARNING)
    return tuple(
        replace(one, severity=Severity.SERIOUS) if (one.code, one.severity) == is_guess else one for one in findings
    )


def _result(calibration: Calibration, findings: Found, segments: Segments, recording: Recording) -> CalibrationResult:
    return CalibrationResult(of_board(replace(calibration, findings=findings), recording), segments, recording)


def of_board(calibration: Calibration, recording: Recording) -> Calibration:
    """The calibration with the flight controller's own corrections, which an export composes with it."""
    if recording.onboard is None:
        return calibration
    extensions = {**calibration.extensions, "onboard": as_plain(recording.onboard)}
    return replace(calibration, extensions=MappingProxyType(extensions))


def _of_fit(calibration: Calibration, recording: Recording, segments: Segments) -> Found:
    """Findings about the fit, its poses, a gyro scale that contradicts its unit, and lost samples."""
    gyro = calibration.gyroscope
    fitted = with_shapes(calibration, segments)
    if gyro is None:
        return fitted
    # The uncertainty without losses, where it is widened by those that are possible.
    possible = [one.numbers["sigma_scale"] for one in fitted if one.code == "losses-possible"]
    sigma_scale = min([relative_sigma(gyro.covariance, gyro.S), *possible])
    missing = tuple(missing_samples(recording, segments, sigma_scale))
    of_gyro = scale_findings(gyro.S, sigma_scale, recording)
    # Losses detected in the motion are not also possible ones of the fit.
    fitted = tuple(one for one in fitted if not (missing and one.code == "losses-possible"))
    return (*fitted, *of_gyro, *missing)
