"""``trihedron calibrate LOG LOG ...``: many recordings of one unit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from trihedron.cli.options import GravitySource, LogSource, LogsSource, one_of, progress
from trihedron.cli.output import FullResults

if TYPE_CHECKING:
    from trihedron.records import Recording

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
    how = one_of("--by", by or "session", ("session", "date", "device", "temperature"))
    from trihedron.api import sessions
    from trihedron.report.machine import sessions_record
    from trihedron.report.sessions import sessions_report

    words = None if labels is None else [word.strip() for word in labels.split(",")]
    given = sources.each()
    with progress("calibrating") as notify:
        # An unreadable log stops the command, unlike a recording that cannot be calibrated.
        recordings = list(_recordings(given, how))
        if words is not None and len(words) == len(given) < len(recordings):
            raise typer.BadParameter("--labels name logs; the devices of an archive have their own names")
        result = sessions.calibrate_sessions(
            recordings,
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


def _recordings(sources: list[LogSource], by: str) -> Iterator[Recording]:
    """Every log; with ``by`` device, every device of an archive."""
    from trihedron.read import devices_of

    for source in sources:
        n = devices_of(source.log) if by == "device" and source.instance is None and source.log is not None else 1
        if n == 1:
            yield source.read()
            continue
        for device in range(1, n + 1):
            recording = replace(source, instance=str(device)).read()
            yield replace(recording, source=f"{recording.source}, device {device}")
