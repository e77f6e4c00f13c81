"""``trihedron apply``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from trihedron.cli.options import Force, Json, LogSource, with_options
from trihedron.cli.output import check_outputs, leave, say, write_json
from trihedron.cli.streamed import Stream, apply_stream


@with_options(source=LogSource)
def apply(
    calibration: Annotated[Path, typer.Argument(metavar="CALIBRATION", help="Calibration file (JSON).")],
    source: LogSource,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Where to write: .csv, .parquet, '-' (CSV on stdout); with --stream .npy.",
        ),
    ] = Path("-"),
    stream: Stream = False,
    json: Json = None,
    force: Force = False,
) -> None:
    """Apply a calibration to a log: time [s], specific force [m/s^2], angular rate [rad/s]."""
    check_outputs(output, json, force=force, inputs=(*source.files, calibration))
    if stream:
        if str(output) == "-" or json is not None:
            raise typer.BadParameter("--stream writes one file: give -o FILE.npy, and no --json")
        apply_stream(calibration, source, output, force=force)
        return
    from trihedron.files.calibration import read_calibration
    from trihedron.files.log import check_format, write_recording

    check_format(output)
    known = read_calibration(calibration)
    recording = source.read()
    from trihedron.api import applying
    from trihedron.records import FindingCode
    from trihedron.report.machine import recording_record

    done = applying.apply(known, recording)
    write_recording(done, output, overwrite=force)
    if str(output) != "-":
        is_even = any(finding.code is FindingCode.EVEN_CLOCK for finding in recording.findings)
        clock = f", timestamps of an even clock of {done.rate_hz:.6g} Hz" if is_even else ""
        say(f"{done.n_samples} samples{clock}: {output}")
    write_json(recording_record(done), json, force=force)
    leave(done.findings)
