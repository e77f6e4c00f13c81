"""``trihedron check``."""

from __future__ import annotations

from trihedron.cli.options import Force, Json, LogSource, Report, progress, with_options
from trihedron.cli.output import check_outputs, leave, tell_all


@with_options(source=LogSource)
def check(source: LogSource, report: Report = None, json: Json = None, force: Force = False) -> None:
    """Is a log fit for calibration? Its faults, its poses, and the uncertainties to expect."""
    check_outputs(json, force=force, report=report, inputs=source.files)
    recording = source.read()
    from trihedron.api import checking
    from trihedron.report import check_report
    from trihedron.report.machine import check_record

    with progress("checking") as tell:
        result = checking.check(recording, progress=tell)
    document = check_report(recording, result.segments, result.calibration, result.findings)
    machine = check_record(recording, result.segments, result.calibration, result.findings)
    tell_all(document, machine, json, report, force=force)
    leave(result.findings)
