"""``trihedron verify``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from trihedron.cli.options import GravitySource, LogSource, LogsSource, progress, with_options
from trihedron.cli.output import NOT_TO_BE_TRUSTED, FullResults
from trihedron.cli.run import note_file
from trihedron.errors import InputError

if TYPE_CHECKING:
    from trihedron.records import Calibration

OPTIONS = {
    "log": typer.Argument(
        metavar="CALIBRATION LOG", help="A calibration file and a log; or a log and several of them."
    ),
    "limit_mg": ("MG", "Largest rms gravity error in static poses that you accept; beyond it the exit status is 2."),
    "limit_deg": ("DEG", "The same for the tilt error after a rotation."),
}


@with_options(OPTIONS, source=LogsSource, place=GravitySource, results=FullResults)
def verify(
    source: LogsSource,
    place: GravitySource,
    *,
    limit_mg: float | None = None,
    limit_deg: float | None = None,
    results: FullResults,
) -> None:
    """Test calibrations on a recording that they were not made from: CALIBRATION LOG, or LOG A B C ...

    Calibrations may be files of other programs (Kalibr, PX4, ArduPilot, ...); several are ranked. Exit status 2 when a
    limit is exceeded, or, without one, when an error is more than ten times the expected one; of several, when the
    best is rejected.
    """
    results.check(inputs=source.files)
    from trihedron.api import ranking, verifying

    paths, log = _parted(source)
    known = _calibrations(paths)
    note_file(paths[0])
    recording = log.read()
    if len(known) > 1:
        with progress("ranking") as notify:
            found = ranking.rank(paths, recording, progress=notify, **place.said)
        note_file(next(path for path in paths if path.name == found.best.name))
        results.emit(found)
        results.leave(found.best.verification.findings)
        if found.best.is_rejected:
            raise typer.Exit(NOT_TO_BE_TRUSTED)
        return
    with progress("verifying") as notify:
        result = verifying.verify(
            known[0], recording, limit_mg=limit_mg, limit_deg=limit_deg, progress=notify, **place.said
        )
    results.emit(result, "Every pose and move: --full, or --report FILE.html with figures.")


def _parted(source: LogsSource) -> tuple[list[Path], LogSource]:
    """Calibrations and the one log among the given files, distinguished by content."""
    from trihedron.files.formats import is_calibration

    named = list(source.log or [])
    logs = [path for path in named if not is_calibration(path)]
    beside = source.accel is not None or source.gyro is not None
    if len(logs) == len(named):
        # No file is a calibration: the first is read as one, and its reader reports the error.
        logs = named[1:]
    if len(logs) > 1 or (beside and logs):
        logs, extra = ([], logs) if beside else (logs[:1], logs[1:])
        try:
            _calibrations(extra)
        except ValueError as error:
            raise InputError(f"{error} If it is a log: one log is tested at a time; run it for each.") from None
    paths = [path for path in named if path not in logs]
    if not paths:
        raise typer.BadParameter("name a calibration file and a log")
    return paths, replace(source, log=logs or None).one()


def _calibrations(paths: list[Path]) -> list[Calibration]:
    from trihedron.files.formats import any_calibration

    return [any_calibration(path) for path in paths]
