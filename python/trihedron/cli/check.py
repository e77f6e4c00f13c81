"""``trihedron check``."""

from trihedron.cli.options import LogSource, progress, with_options
from trihedron.cli.output import Results


@with_options(source=LogSource, results=Results)
def check(source: LogSource, results: Results) -> None:
    """Is a log fit for calibration? Its faults, its poses, and the uncertainties to expect."""
    results.check(inputs=source.files)
    recording = source.read()
    from trihedron.api import checking

    with progress("checking") as notify:
        result = checking.check(recording, progress=notify)
    results.emit(result)
