"""``trihedron segment``."""

from __future__ import annotations

from trihedron.cli.options import Force, Json, LogSource, Report, progress, with_options
from trihedron.cli.output import check_outputs, leave, tell_all
from trihedron.cli.streamed import Kept, Stream, needs_stream, segment_stream


@with_options(source=LogSource)
def segment(
    source: LogSource,
    stream: Stream = False,
    checkpoint: Kept = None,
    report: Report = None,
    json: Json = None,
    force: Force = False,
) -> None:
    """Find the poses and the moves between them."""
    check_outputs(json, force=force, report=report, inputs=source.files)
    needs_stream(checkpoint, stream=stream)
    if stream:
        segment_stream(source, report, json, checkpoint, force=force)
        return
    recording = source.read()
    from trihedron.api import reading
    from trihedron.report import segments_report
    from trihedron.report.machine import segments_record

    with progress("segmenting") as tell:
        segments = reading.segment(recording, progress=tell)
    document, machine = segments_report(segments, recording), segments_record(segments, recording)
    tell_all(document, machine, json, report, force=force)
    leave((*recording.findings, *segments.findings))
