"""``trihedron convert``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from trihedron.cli.options import Force, Json, LogSource, with_options
from trihedron.cli.output import check_outputs, leave, say, write_json


@with_options(source=LogSource)
def convert(
    source: LogSource,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="Where to write: .csv, .npz, .parquet.")
    ],
    json: Json = None,
    force: Force = False,
) -> None:
    """Write any log that is read as a plain table: time [s] and readings in their own unit, units in the names."""
    check_outputs(output, json, force=force, inputs=source.files)
    from trihedron.files.log import LOG_SUFFIXES
    from trihedron.files.output import OutputError

    if output.suffix.lower() not in LOG_SUFFIXES:
        raise OutputError(f"{output}: a log is written as {', '.join(LOG_SUFFIXES)}; give it one of these endings.")
    recording = source.read()
    from trihedron.api import converting
    from trihedron.report.machine import recording_record

    converting.convert(recording, output, overwrite=force)
    for finding in recording.findings:
        if finding.severity.value != "note" or finding.code.value in {"rows-left-out", "device-chosen"}:
            say(str(finding))
    rows = (
        f"{recording.rows_in_file} rows in the file = {recording.rows_read} read + {recording.rows_reported} reported"
    )
    say(f"{recording.n_samples} samples at {recording.rate_hz:.5g} Hz ({rows}): {output}")
    write_json(recording_record(recording), json, force=force)
    leave(recording.findings)
