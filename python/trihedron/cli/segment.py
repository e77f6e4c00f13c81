"""``trihedron segment``."""

from trihedron.cli.options import LogSource, progress, with_options
from trihedron.cli.output import Results, leave
from trihedron.cli.streamed import opened


@with_options(source=LogSource, results=Results)
def segment(source: LogSource, *, stream: bool = False, results: Results) -> None:
    """Find the poses and the moves between them."""
    results.check(inputs=source.files)
    from trihedron.report.machine import segments_record
    from trihedron.report.segments import segments_report

    if stream:
        log = opened(source)
        from trihedron.api.streaming import condensed, segment_file

        with progress("segmenting") as notify:
            found = segment_file(log, progress=notify)
        # Figures and times are from the rows of moves and of the ends of poses.
        recording, segments = condensed(log, found)
    else:
        recording = source.read()
        from trihedron.api import reading

        with progress("segmenting") as notify:
            segments = reading.segment(recording, progress=notify)
    document = segments_report(segments, recording)
    results.show(document)
    results.write(document, lambda: segments_record(segments, recording))
    leave((*recording.findings, *segments.findings))
