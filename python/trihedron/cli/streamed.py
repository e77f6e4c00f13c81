"""``--stream`` of ``segment``, ``calibrate`` and ``apply``: logs larger than memory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from trihedron.cli.options import GravitySource, LogSource, progress
from trihedron.cli.output import Ending, Results, leave, say

if TYPE_CHECKING:
    from trihedron.api.streaming import LogOnDisk

Stream = Annotated[
    bool,
    typer.Option(
        "--stream",
        help="A .npy, Parquet or CSV log larger than memory, in pieces and without audit: --columns, --rate and the "
        "units state what it holds. Memory: apply 0.2 GB, segment 0.5 GB and 15 MB an hour, calibrate what its fit "
        "takes.",
    ),
]

Kept = Annotated[
    Path | None,
    typer.Option(
        "--checkpoint",
        metavar="FILE",
        help="With --stream: keep how far the pass is in FILE, so that a run that was stopped goes on from there.",
    ),
]


def needs_stream(checkpoint: Path | None, *, stream: bool) -> None:
    """Check that a checkpoint is given only with ``--stream``.

    Raises
    ------
    typer.BadParameter
        When there is a checkpoint without a stream.
    """
    if checkpoint is not None and not stream:
        raise typer.BadParameter("--checkpoint belongs to --stream")


def opened(source: LogSource) -> LogOnDisk:
    """The log on disk.

    Raises
    ------
    typer.BadParameter
        When an option that streaming needs is missing.
    """
    if source.log is None or source.columns is None or source.rate is None:
        raise typer.BadParameter("--stream needs LOG, --columns (as in ax,ay,az,gx,gy,gz) and --rate")
    from trihedron.api.streaming import log_on_disk

    # A text log is first converted to a table, which takes time.
    with progress("opening"):
        return log_on_disk(
            source.log,
            columns=source.columns,
            rate_hz=source.rate,
            accelerometer_unit=source.accel_unit,
            gyroscope_unit=source.gyro_unit,
        )


def segment_stream(source: LogSource, results: Results, checkpoint: Path | None) -> None:
    """Poses of a log on disk."""
    log = opened(source)
    from trihedron.api.streaming import condensed, segment_file
    from trihedron.report import segments_report
    from trihedron.report.machine import segments_record

    with progress("segmenting") as tell:
        segments = segment_file(log, checkpoint=checkpoint, progress=tell)
    # Figures and times are from the rows of moves and of the ends of poses.
    recording, shown = condensed(log, segments)
    document, machine = segments_report(shown, recording), segments_record(shown, recording)
    results.tell(document, machine)
    leave(segments.findings)


def calibrate_stream(
    source: LogSource,
    place: GravitySource,
    options: dict[str, Any],
    ending: Ending,
    sections: int,
    checkpoint: Path | None,
) -> None:
    """A calibration from a log on disk."""
    log = opened(source)
    from trihedron.api.streaming import calibrate_file
    from trihedron.report import calibration_report

    with progress("calibrating") as tell:
        result = calibrate_file(log, checkpoint=checkpoint, progress=tell, **place.said, **options)
    document = calibration_report(result.calibration, result.segments, result.recording)

    def machine() -> dict[str, Any]:
        from trihedron.report.machine import calibration_record

        return calibration_record(result.calibration, result.segments, result.recording)

    ending.tell(document, machine, result.calibration, sections)


def apply_stream(calibration: Path, source: LogSource, output: Path, *, force: bool) -> None:
    """Corrected readings of a log on disk, as .npy."""
    log = opened(source)
    from trihedron.api.applying import doubted
    from trihedron.api.streaming import apply_file
    from trihedron.files.calibration import read_calibration

    known = read_calibration(calibration)
    with progress("applying") as tell:
        written = apply_file(known, log, output, overwrite=force, progress=tell)
    went_on = "" if written == log.n_samples else f", {log.n_samples - written} of them by an earlier run"
    say(f"{log.n_samples} samples{went_on}: {output}")
    leave(doubted(known))
