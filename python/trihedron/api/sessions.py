"""Many recordings of one unit: each calibrated, then common parameters, repeatability and changes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from trihedron.api.calibrating import calibrate
from trihedron.api.reading import AnyRecording, recording_of
from trihedron.api.sessions_combined import amount_of, combine
from trihedron.defaults import FALSE_ALARM
from trihedron.errors import INPUT_ERRORS, InputError
from trihedron.estimate.sessions.changes import changes_among, of_another_unit
from trihedron.estimate.sessions.numbers import sessions_of
from trihedron.records import Finding, Frame, Progress, Recording, Severity
from trihedron.records.recording import as_arguments
from trihedron.records.results import CalibrationResult, SessionsResult
from trihedron.records.sessions import By, Change, Session
from trihedron.records.words import Words, words

BYS: tuple[By, ...] = get_args(By)
LEFT_BY_S_AND_B = (
    "residual-above-noise",
    "held-out-worse",
    "gyro-g-sensitivity",
    "gyro-bias-drift",
)


def calibrate_sessions(
    recordings: Sequence[AnyRecording | CalibrationResult],
    *,
    by: By = "session",
    labels: Sequence[str] | None = None,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
    frame: Frame = "lower",
    alpha: float = FALSE_ALARM,
    progress: Progress | None = None,
) -> SessionsResult:
    """Calibrate many recordings of one unit, with the repeatability of each parameter.

    Parameters
    ----------
    recordings : sequence of Recording, CalibrationResult, or what trihedron.read takes
        Two or more, in their order in time; each is calibrated by :func:`calibrate` where it is not yet.
    by : "session", "date" or "temperature"
        Groups of sessions: every recording alone, those of one day; or polynomials of temperature through all of them.
    labels : sequence of str, optional
        One word per recording, instead of its date.
    gravity_m_s2 or latitude_deg, height_m : float
        As for :func:`calibrate`.
    frame : "lower" or "symmetric"
        Body frame of the common calibration.
    alpha : float
        Probability that any parameter of a unit that did not change is called changed.
    progress : callable
        Called with the share done (0 to 1) and what is being done.

    Returns
    -------
    SessionsResult
        ``calibration`` common to all sessions; ``model`` with repeatability and changes.

    Raises
    ------
    ValueError
        When fewer than two recordings can be calibrated, a file is given twice, or their group is unknown.

    Examples
    --------
    >>> other, _ = trihedron.simulate("hand-session", 4)
    >>> model = trihedron.calibrate_sessions([recording, other], gravity_m_s2=9.80665)
    >>> len(model.model.sessions)
    2
    """
    if by not in BYS:
        raise InputError(f"recordings are not grouped by {by!r}; choose one of {', '.join(BYS)}.")
    if labels is not None and len(labels) != len(recordings):
        raise InputError(f"{len(labels)} labels were given for {len(recordings)} recordings; give one for each.")
    notify = progress or (lambda _fraction, _text: None)
    results: list[CalibrationResult] = []
    groups: list[str] = []
    left_out: list[tuple[str, str]] = []
    for k, given in enumerate(recordings):
        recording = recording_of(given)
        refuse_again(recording, (result.recording for result in results))
        label = _label(recording, by) if labels is None else labels[k]
        notify(k / len(recordings), f"calibrating {Path(recording.source).name}")
        try:
            if isinstance(given, CalibrationResult):
                result = given
            else:
                place = {"gravity_m_s2": gravity_m_s2, "latitude_deg": latitude_deg, "height_m": height_m}
                result = calibrate(recording, **place)  # type: ignore[arg-type]
        except INPUT_ERRORS as error:
            left_out.append((recording.source, str(error)))
            continue
        why = _unfit(result, results)
        if why:
            left_out.append((recording.source, why))
            continue
        results.append(result)
        groups.append(label)
    if len(results) < 2:
        reasons = "; ".join(f"{Path(name).name}: {reason}" for name, reason in left_out) or "one recording was given"
        if len(recordings) > 1 and all(recording_of(given).gyroscope is None for given in recordings):
            reasons = "no log has a gyro: the logs of both sensors of one recording are given with --accel and --gyro"
        raise InputError(f"two recordings at least are needed to see what repeats ({reasons}).")
    sessions = sessions_of(results, groups)
    model = combine(sessions, by, results[0].calibration, frame=frame, alpha=alpha, left_out=tuple(left_out))
    of_place = (one for one in results[0].findings if one.code == "gravity-defaulted")
    several = several_devices(sessions, model.changes, "calibrated")
    findings = (*several, *of_place, *_doubts(results, sessions), *model.findings)
    model = replace(model, calibration=replace(model.calibration, findings=findings), findings=findings)
    return SessionsResult(model, tuple(results))


def _doubts(results: Sequence[CalibrationResult], sessions: Sequence[Session]) -> Iterator[Finding]:
    """Clipping of every recording, and its gravest warning about what S and b leave: the common ones leave it too."""
    doubted: dict[str, list[tuple[str, str, str]]] = {}
    for result, session in zip(results, sessions, strict=True):
        warned = {f.code: f.seen for f in result.findings if f.severity is Severity.WARNING}
        gravest = [code for code in LEFT_BY_S_AND_B if code in warned][:1]
        for code in (*gravest, *(code for code in warned if code == "clipping")):
            one = session.name, warned[code], as_arguments(result.recording.source)
            doubted.setdefault(code, []).append(one)
    stated = {"clipping", "gravity-defaulted", *doubted}
    also = []
    for result, session in zip(results, sessions, strict=True):
        others = (f.code for f in result.findings if f.severity is Severity.WARNING and f.code not in stated)
        also.append((session.name, list(dict.fromkeys(others))))
    if any(codes for _, codes in also):
        yield Finding.of("calibration-doubted", "others", recordings=[one for one in also if one[1]])
    for code, said in doubted.items():
        name, warning, path = said[0]
        seen = words("quoted", sentence=warning)
        yield Finding.of(
            "clipping" if code == "clipping" else "calibration-doubted",
            "of-recordings",
            n=len(said),
            n_all=len(results),
            name=name,
            seen=seen,
            path=path,
        )


def refuse_again(recording: Recording, others: Iterable[Recording]) -> None:
    """Raise where the readings of a file were given before: their evidence would count twice.

    Devices of one archive share its ``sha256`` and differ in readings.
    """
    for other in others:
        if recording.sha256 and recording.sha256 == other.sha256:
            pairs = ((getattr(one, name) for one in (recording, other)) for name in ("accelerometer", "gyroscope"))
            if all(a is b is None or np.array_equal(a, b, equal_nan=True) for a, b in pairs):
                raise InputError(f"{recording.source}: the same recording as {other.source}; give each once.")


def _unfit(result: CalibrationResult, others: Sequence[CalibrationResult]) -> Words | None:
    """Why a calibration cannot be combined with the others; None where it can."""
    if not result.is_trustworthy:
        serious = next(finding for finding in result.findings if finding.severity.value == "serious")
        return words("not-trusted", seen=serious.seen)
    if others:
        first, own = others[0].calibration, result.calibration
        for name in ("accelerometer", "gyroscope"):
            a, b = getattr(first, name), getattr(own, name)
            if (a is None) != (b is None):
                return words("sensor-not-calibrated" if b is None else "first-lacks-sensor", sensor=name)
            if a is not None and a.raw_unit != b.raw_unit:
                return words("another-unit", sensor=name, unit=b.raw_unit, first_unit=a.raw_unit)
        if not math.isclose(first.gravity_m_s2, own.gravity_m_s2, rel_tol=1e-6):
            return words("another-gravity")
        if first.extensions.get("onboard") != own.extensions.get("onboard"):
            return words("another-correction")
    return None


def of_several_units(results: Sequence[CalibrationResult]) -> tuple[Finding, ...]:
    """Findings where recordings differ by more than those of one unit."""
    alike = [one for k, one in enumerate(results) if _unfit(one, results[:k]) is None]
    if len(alike) < 2:
        return ()
    sessions = sessions_of(alike, [""] * len(alike))
    return several_devices(sessions, changes_among([sessions], alpha=FALSE_ALARM))


def several_devices(
    sessions: Sequence[Session], changes: Sequence[Change], case: Literal["", "calibrated"] = ""
) -> tuple[Finding, ...]:
    """A finding for every change that one unit does not make."""
    return tuple(
        Finding.of("several-devices", case, parameter=one.id, amount=amount_of(one))
        for one in of_another_unit(sessions, changes)
    )


def _label(recording: Recording, by: By) -> str:
    if by == "date":
        if recording.start_epoch_s <= 0.0:
            raise InputError(
                f"{recording.source}: the log does not say on which day it was recorded; give --labels DAY,DAY,..., "
                "one word for each recording."
            )
        return datetime.fromtimestamp(recording.start_epoch_s, tz=timezone.utc).date().isoformat()
    return recording.source
