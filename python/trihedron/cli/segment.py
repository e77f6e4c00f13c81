"""``trihedron segment``."""

from __future__ import annotations

from trihedron.cli.options import LogSource, progress, with_options
from trihedron.cli.output import Results, leave
from trihedron.cli.streamed import Kept, Stream, needs_stream, segment_stream


@with_options(source=LogSource, results=Results)
def segment(source: LogSource, *, stream: Stream = False, checkpoint: Kept = None, results: Results) -> None:
    """Find the poses and the moves between them."""
    results.check(inputs=source.files)
    needs_stream(checkpoint, stream=stream)
    if stream:
        segment_stream(source, results, checkpoint)
        return
    recording = source.read()
    from trihedron.api import reading
    from trihedron.report import segments_report
    from trihedron.report.machine import segments_record

    with progress("segmenting") as tell:
        segments = reading.segment(recording, progress=tell)
    document, machine = segments_report(segments, recording), segments_record(segments, recording)
    results.tell(document, machine)
    leave((*recording.findings, *segments.findings))
