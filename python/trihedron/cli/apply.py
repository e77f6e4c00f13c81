"""``trihedron apply``."""

from pathlib import Path

import typer

from trihedron.cli.options import LogSource, with_options
from trihedron.cli.output import Results, leave, say
from trihedron.cli.run import note_file, with_commands
from trihedron.cli.streamed import apply_stream

OPTIONS = {
    "calibration": typer.Argument(metavar="CALIBRATION", help="Calibration file (JSON)."),
    "output": ("FILE", "Where to write: .csv, .parquet, '-' (CSV on stdout); with --stream .npy.", "-o"),
}


@with_options(OPTIONS, source=LogSource)
def apply(
    calibration: Path,
    source: LogSource,
    output: Path = Path("-"),
    stream: bool = False,
    json: Path | None = None,
    force: bool = False,
) -> None:
    """Apply a calibration to a log: time [s], specific force [m/s^2], angular rate [rad/s]."""
    results = Results(json, force=force)
    results.check(output, inputs=(*source.files, calibration))
    if stream:
        if str(output) == "-" or json is not None:
            raise typer.BadParameter("--stream writes one file: give -o FILE.npy, and no --json")
        apply_stream(calibration, source, output, force=force)
        return
    from trihedron.files.calibration import read_calibration
    from trihedron.files.log import check_suffix, write_recording

    if str(output) != "-":
        check_suffix(output)
    known = read_calibration(calibration)
    note_file(calibration)
    recording = source.read()
    from trihedron.api import applying
    from trihedron.records import Severity
    from trihedron.report.findings import likely
    from trihedron.report.machine import recording_record

    done = applying.apply(known, recording)
    write_recording(done, output, overwrite=force)
    if str(output) != "-":
        is_even = any(finding.code == "even-clock" for finding in recording.findings)
        clock = f", timestamps of an even clock of {done.rate_hz:.6g} Hz" if is_even else ""
        say(f"{done.n_samples} samples{clock}: {output}")
    for one in done.findings:
        # No calibration restores what a range limit cut off; other findings on the log are those of reading it.
        is_told = one not in recording.findings or one.code == "clipping"
        if is_told and one.severity is not Severity.SERIOUS:
            seen = one.seen if one.severity is Severity.NOTE else f"{one.severity.value}: {one.seen}"
            say(with_commands(" ".join(filter(None, (seen, likely(one.cause), one.action and f"→ {one.action}")))))
    results.write_json(lambda: recording_record(done))
    leave(done.findings)
