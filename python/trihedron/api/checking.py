"""Check whether a log is fit for calibration, and the uncertainties to expect."""

from __future__ import annotations

from dataclasses import replace

from trihedron.api.calibrating import calibrate
from trihedron.api.diagnosing_static_log import MOSTLY, TWO_ORIENTATIONS, is_static_log
from trihedron.api.reading import COUNTS_OF_POSES, FEWEST_POSES, AnyRecording, recording_of, segment
from trihedron.errors import INPUT_ERRORS
from trihedron.records import Finding, Progress, Recording, Segments, Severity
from trihedron.records.noise import least_length_s
from trihedron.records.results import CheckResult
from trihedron.records.words import words
from trihedron.segment.judge import POSES_FOR_NINE
from trihedron.units import STANDARD_GRAVITY_M_S2


def check(recording: AnyRecording, *, progress: Progress | None = None) -> CheckResult:
    """Whether a log is fit for calibration: its faults, its poses, and the uncertainties to expect.

    The uncertainties follow from the poses, the moves and the sensor's noise; they hardly depend on gravity, which is
    not needed.

    Parameters
    ----------
    recording : Recording, or what trihedron.read takes
        The log to check.
    progress : callable(share done from 0 to 1, what is being done)

    Returns
    -------
    CheckResult
        ``is_fit``, ``findings``, the poses found and the uncertainties to expect.

    Raises
    ------
    ValueError
        When the log cannot be read.

    Examples
    --------
    >>> trihedron.check(recording).is_fit
    True
    """
    recording = recording_of(recording)
    segments = segment(recording, progress=progress)
    duration_s = float(recording.time_s[-1] - recording.time_s[0])
    least_s = least_length_s(recording.rate_hz)
    static = (
        Finding.of("not-fit", "static-log", duration_s=duration_s)
        if duration_s >= least_s
        else Finding.of("not-fit", "short-static-log", duration_s=duration_s, least_s=least_s)
    )
    # Standard gravity: only the size of the uncertainties is needed, for which an error of 0.4 % is negligible.
    try:
        result = calibrate(recording, segments=segments, gravity_m_s2=STANDARD_GRAVITY_M_S2)
    except INPUT_ERRORS as error:
        lasts_s = float(segments.duration_s.sum())
        if 0 < segments.n_poses <= TWO_ORIENTATIONS and lasts_s > MOSTLY * duration_s:
            return CheckResult(recording, segments, None, (static, *recording.findings))
        return CheckResult(recording, segments, None, (*recording.findings, *_why_not(recording, segments, str(error))))
    if is_static_log(recording, segments, lambda: result.calibration):
        if recording.gyroscope is None and segments.n_poses >= POSES_FOR_NINE:
            static = Finding.of("not-fit", "same-poses", n_poses=segments.n_poses)
        return CheckResult(recording, segments, None, (static, *recording.findings, *segments.findings))
    return CheckResult(recording, segments, result.calibration, result.findings)


def _why_not(recording: Recording, segments: Segments, error: str) -> tuple[Finding, ...]:
    """Findings of the segmentation: serious where they count too few poses, else with the error of the calibration."""
    has_few = recording.accelerometer is not None and segments.n_poses < FEWEST_POSES
    if has_few and any(one.code in COUNTS_OF_POSES for one in segments.findings):
        return tuple(
            replace(one, severity=Severity.SERIOUS) if one.code in COUNTS_OF_POSES else one for one in segments.findings
        )
    why = words("because", sentence=error.removeprefix(f"{recording.source}: "))
    return (*segments.findings, Finding.of("not-fit", "no-calibration", why=why))
