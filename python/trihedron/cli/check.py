"""``trihedron check``."""

from trihedron.cli.options import LogSource, progress, with_options
from trihedron.cli.output import Results, is_stdout, leave


@with_options(source=LogSource, results=Results)
def check(source: LogSource, results: Results) -> None:
    """Is a log fit for calibration? Its faults, its poses, and the uncertainties to expect."""
    results.check(inputs=source.files)
    recording = source.read()
    from trihedron.api import checking
    from trihedron.report.check import check_report
    from trihedron.report.machine import check_record

    with progress("checking") as notify:
        result = checking.check(recording, progress=notify)
    shown = (recording, result.segments, result.calibration, result.findings)
    results.emit(check_report(*shown), lambda: check_record(*shown))
    leave(result.findings, is_shown=not is_stdout(results.json))
