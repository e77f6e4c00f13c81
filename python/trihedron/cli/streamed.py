"""``--stream`` of ``segment``, ``calibrate`` and ``apply``: logs larger than memory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from trihedron.cli.options import GravitySource, LogSource, progress
from trihedron.cli.output import leave, say

if TYPE_CHECKING:
    from trihedron.read.on_disk import LogOnDisk
    from trihedron.records.results import CalibrationResult


def opened(source: LogSource) -> LogOnDisk:
    """The log on disk; rejected where an option that streaming needs is missing."""
    if source.log is None or source.columns is None or source.rate is None:
        raise typer.BadParameter("--stream needs LOG, --columns (as in ax,ay,az,gx,gy,gz) and --rate")
    from trihedron.read.on_disk import log_on_disk

    # A text log is first converted to a table, which takes time.
    with progress("opening"):
        return log_on_disk(source.log, columns=source.columns, rate_hz=source.rate, **source.units)


def calibrate_stream(source: LogSource, place: GravitySource, options: dict[str, Any]) -> CalibrationResult:
    """A calibration from a log on disk."""
    log = opened(source)
    from trihedron.api.streaming import calibrate_file

    with progress("calibrating") as notify:
        return calibrate_file(log, progress=notify, **place.said, **options)


def apply_stream(calibration: Path, source: LogSource, output: Path, *, force: bool) -> None:
    """Corrected readings of a log on disk, as .npy."""
    log = opened(source)
    from trihedron.api.applying import doubted
    from trihedron.api.streaming import apply_file
    from trihedron.files.calibration import read_calibration

    known = read_calibration(calibration)
    with progress("applying") as notify:
        written = apply_file(known, log, output, overwrite=force, progress=notify)
    say(f"{written} samples: {output}")
    leave(doubted(known))
