"""``trihedron calibrate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from trihedron.cli.options import (
    GravitySource,
    LogsSource,
    numbers,
    one_of,
    progress,
    signs,
    whole_numbers,
    with_options,
)
from trihedron.cli.output import FIRST_SCREEN, FullResults
from trihedron.cli.streamed import calibrate_stream

if TYPE_CHECKING:
    from trihedron.records.results import ReferencesResult, SessionsResult

OPTIONS = {
    "method": ("NAME", "joint: any poses, both sensors in one fit. separate: one after the other. faces: six faces."),
    "frame": (
        "NAME",
        "Body frame: lower (lower-triangular, X along accelerometer X), symmetric, or case (with --method faces).",
    ),
    "faces": (
        "LIST",
        "With --method faces: axis up in each pose, 1 for +X to -3 for -Z, '1,-1,2,-2,3,-3'; 0 excludes one.",
    ),
    "turns": ("LIST", "Angle of each turn on a table in degrees, '90,-90,360', in any pose; 0 excludes one."),
    "turntable": (
        "SPEEDS",
        "Speeds of a turntable in deg/s, the unit mounted in any way: one for all steady turns, or one each, '45,90'.",
    ),
    "turntable_error": ("PERCENT", "Standard error of the turntable's speed, common to all turns."),
    "axis_signs": ("+++", "Sign of each raw axis relative to its documented direction, e.g. '-++'."),
    "gyro_nominal": ("X", "Nominal rad/s per gyro unit, where counts and few moves do not determine it."),
    "reference": ("MOTION", "Known motion beside the log: attitude, rate, pose or a log; one for each log."),
    "extended": "Diagnose the log too and store the accepted effects, which `trihedron apply` then compensates.",
    "by": ("HOW", "Several logs: by session (each for itself), date, or temperature."),
    "labels": ("LIST", "Several logs: the day of each, with commas between."),
}


@with_options(OPTIONS, sources=LogsSource, place=GravitySource, results=FullResults)
def calibrate(
    sources: LogsSource,
    place: GravitySource,
    *,
    method: str = "joint",
    frame: str | None = None,
    faces: str | None = None,
    turns: str | None = None,
    turntable: str | None = None,
    turntable_error: float = 0.0,
    axis_signs: str | None = None,
    gyro_nominal: float | None = None,
    reference: list[Path] | None = None,
    reference_columns: str | None = None,
    extended: bool = False,
    stream: bool = False,
    by: str | None = None,
    labels: str | None = None,
    output: Path | None = None,
    results: FullResults,
) -> None:
    """Calibrate both sensors from a log of poses and moves.

    Several logs of one unit give common parameters and the repeatability of each.
    """
    results.check(output, inputs=sources.files)
    choices: dict[str, Any] = {
        "method": one_of("--method", method, ("joint", "separate", "faces")),
        "frame": None if frame is None else one_of("--frame", frame, ("lower", "symmetric", "case")),
        "faces": None if faces is None else whole_numbers("--faces", faces),
        "turns_deg": None if turns is None else numbers("--turns", turns),
        "axis_signs": None if axis_signs is None else signs("--axis-signs", axis_signs),
    }
    if turntable is not None:
        choices |= {"turntable_deg_s": numbers("--turntable", turntable), "turntable_sigma": turntable_error / 100.0}
    if sources.are_many(by):
        if reference:
            beside = _beside(sources, reference, reference_columns, choices["frame"], place)
            results.emit(beside, "Bias over time: --json FILE.", output=output)
            return
        if extended or gyro_nominal is not None or {k for k, v in choices.items() if v} - {"method", "frame"}:
            raise typer.BadParameter(
                "--extended, --method faces, --turns and --turntable are for one log: "
                "several logs are calibrated without them"
            )
        if method != "joint":
            raise typer.BadParameter("several logs are calibrated with --method joint")
        together = _together(sources, by or "session", labels, choices["frame"], place)
        more = "What changed and every recording: --full, or --report FILE.html with figures."
        results.emit(together, more, output=output)
        return
    choices["gyroscope_nominal"] = gyro_nominal
    if stream and extended:
        raise typer.BadParameter("--extended needs the whole log; leave out --stream")
    if labels is not None and not stream:
        raise typer.BadParameter("--labels belong to several logs")
    if stream:
        result = calibrate_stream(sources.one(), place, choices)
    else:
        choices |= {"reference": _only(reference), "reference_columns": reference_columns}
        result = _calibrated(sources, place, choices, extended=extended)
    more = "Every pose and move: --full, or --report FILE.html with figures."
    results.emit(result, more, sections=FIRST_SCREEN + (result.reference is not None), output=output)


def _calibrated(sources: LogsSource, place: GravitySource, choices: dict[str, Any], *, extended: bool) -> Any:
    recording = sources.one().read()
    from trihedron.api import calibrating

    with progress("calibrating") as notify:
        result = calibrating.calibrate(recording, **place.said, progress=notify, **choices)
        if extended:
            from trihedron.api import extending

            result = extending.extend(result, progress=notify)
    return result


def _only(references: list[Path] | None) -> Path | None:
    if references and len(references) > 1:
        raise typer.BadParameter(f"{len(references)} references are for as many logs, not for one")
    return references[0] if references else None


def _beside(
    sources: LogsSource, references: list[Path], columns: str | None, frame: Any, place: GravitySource
) -> ReferencesResult:
    """One unit calibrated from several logs with a reference each."""
    given = sources.each()
    if len(given) != len(references):
        raise typer.BadParameter(f"{len(given)} logs need as many references, not {len(references)}")
    from trihedron.api.references import calibrate_references

    with progress("calibrating"):
        logs = [source.read() for source in given]
        return calibrate_references(logs, references, reference_columns=columns, frame=frame, **place.said)


def _together(sources: LogsSource, by: str, labels: str | None, frame: Any, place: GravitySource) -> SessionsResult:
    """Every log calibrated, and common parameters with their repeatability."""
    how: Any = one_of("--by", by, ("session", "date", "temperature"))
    words = None if labels is None else [word.strip() for word in labels.split(",")]
    from trihedron.api.sessions import calibrate_sessions

    with progress("calibrating") as notify:
        # An unreadable log stops the command, unlike a recording that cannot be calibrated.
        logs = [source.read() for source in sources.each()]
        said = place.said | {"frame": frame or "lower", "progress": notify}
        return calibrate_sessions(logs, by=how, labels=words, **said)
