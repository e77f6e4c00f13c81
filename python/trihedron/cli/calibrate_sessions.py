"""``trihedron calibrate LOG LOG ...``: many recordings of one unit."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from trihedron.cli.options import GravitySource, LogsSource, one_of, progress
from trihedron.cli.output import FullResults

if TYPE_CHECKING:
    pass

FIRST_SCREEN = 2


def calibrate_beside(
    sources: LogsSource,
    references: list[Path],
    columns: str | None,
    place: GravitySource,
    frame: Any,
    output: Path | None,
    results: FullResults,
) -> None:
    """Calibrate one unit from several logs with a reference each; print shared and individual parameters."""
    given = sources.each()
    if len(given) != len(references):
        raise typer.BadParameter(f"{len(given)} logs need as many references, not {len(references)}")
    from trihedron.api.references import calibrate_references
    from trihedron.files.calibration import calibration_document
    from trihedron.report.reference import references_report

    with progress("calibrating"):
        result = calibrate_references(
            [source.read() for source in given],
            references,
            reference_columns=columns,
            frame=frame,
            **place.said,
        )
    document = references_report(result.calibration, result.references)

    def machine() -> dict[str, Any]:
        record = calibration_document(result.calibration)
        return {**record, "references": [one.to_dict() for one in result.references]}

    more = "Bias over time: --json FILE."
    results.emit_calibration(document, machine, result.calibration, output, FIRST_SCREEN, more)


def calibrate_many(
    sources: LogsSource,
    place: GravitySource,
    by: str | None,
    labels: str | None,
    frame: Any,
    output: Path | None,
    results: FullResults,
) -> None:
    """Calibrate every log; print common parameters and their repeatability."""
    how = one_of("--by", by or "session", ("session", "date", "temperature"))
    from trihedron.api import sessions
    from trihedron.report.machine import sessions_record
    from trihedron.report.sessions import sessions_report

    words = None if labels is None else [word.strip() for word in labels.split(",")]
    given = sources.each()
    with progress("calibrating") as notify:
        # An unreadable log stops the command, unlike a recording that cannot be calibrated.
        result = sessions.calibrate_sessions(
            [source.read() for source in given],
            by=how,  # type: ignore[arg-type]
            labels=words,
            frame=frame or "lower",
            progress=notify,
            **place.said,
        )
    document = sessions_report(result.model)
    more = "What changed and every recording: --full, or --report FILE.html with figures."
    machine = partial(sessions_record, result.model)
    results.emit_calibration(document, machine, result.calibration, output, FIRST_SCREEN, more)
