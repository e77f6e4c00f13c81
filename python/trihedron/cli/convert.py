"""``trihedron convert``."""

from pathlib import Path

from trihedron.cli.options import LogSource, with_options
from trihedron.cli.output import Results, leave, say


@with_options({"output": ("FILE", "Where to write: .csv, .npz, .parquet.", "-o")}, source=LogSource)
def convert(source: LogSource, output: Path, json: Path | None = None, force: bool = False) -> None:
    """Write any log that is read as a plain table: time [s] and readings in their own unit, units in the names."""
    results = Results(json, force=force)
    results.check(output, inputs=source.files)
    from trihedron.files.log import check_suffix

    check_suffix(output)
    recording = source.read()
    from trihedron.api import reading
    from trihedron.report.machine import recording_record

    reading.convert(recording, output, overwrite=force)
    for finding in recording.findings:
        if finding.severity.value != "note" or finding.code in {"rows-left-out", "device-chosen"}:
            say(str(finding))
    rows = (
        f"{recording.rows_in_file} rows in the file = {recording.rows_read} read + {recording.rows_reported} reported"
    )
    say(f"{recording.n_samples} samples at {recording.rate_hz:.5g} Hz ({rows}): {output}")
    results.write_json(lambda: recording_record(recording))
    leave(recording.findings)
