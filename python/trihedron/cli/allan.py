"""``trihedron allan``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from trihedron.cli.options import LogSource, progress, with_options
from trihedron.cli.output import FIRST_SCREEN, FullResults, say
from trihedron.files.output import write_whole

if TYPE_CHECKING:
    from trihedron.records import Noise

OPTIONS = {
    "gyro_lsb": ("SIZE", "Size of the gyro's count, as in '0.05 deg/s'."),
    "accel_lsb": ("SIZE", "Size of the accelerometer's count, as in '3.33 mg'."),
    "calibration": ("FILE", "Calibration of the unit: it gives the size of a count."),
    "exclude": (
        "FROM:TO",
        "Leave out this interval [s]; :TO from the start, FROM: to the end; may be given more than once.",
    ),
    "keep_events": "Exclude nothing automatically: impacts, vibration and jumps of the mean stay in.",
    "accuracy": ("PERCENT", "With --full: how long to record for this uncertainty of each term."),
    "plot": ("FILE.png", "Draw the Allan curves (also in the report)."),
    "csv": ("FILE", "Write the Allan curve as a table."),
    "stream": "Read a .npy, Parquet or CSV log in pieces, in at most 1.5 GB and without audit: --columns, --rate and "
    "the units state what it contains.",
    "full": "Print customary units, how long to record and Kalibr's names as well.",
}


@with_options(OPTIONS, source=LogSource, results=FullResults)
def allan(
    source: LogSource,
    *,
    gyro_lsb: str | None = None,
    accel_lsb: str | None = None,
    calibration: Path | None = None,
    exclude: list[str] | None = None,
    keep_events: bool = False,
    accuracy: float = 10.0,
    plot: Path | None = None,
    csv: Path | None = None,
    stream: bool = False,
    results: FullResults,
) -> None:
    """Identify the noise terms of a long static log: how large, how certain, how long to average."""
    intervals = [_interval(text) for text in exclude or []]
    if not 0.0 < accuracy < 1000.0:
        raise typer.BadParameter(f"--accuracy is a positive number of per cent, not {accuracy:g}")
    results.check(csv, plot, inputs=(*source.files, calibration))
    if calibration is not None and stream:
        raise typer.BadParameter("--calibration goes with a log that is read whole: no --stream")
    options: dict[str, Any] = {"exclude_s": intervals, "automatic": not keep_events}
    options |= {"gyroscope_lsb": gyro_lsb, "accelerometer_lsb": accel_lsb}
    found = _of_file(source, options) if stream else _of_log(source, calibration, options)
    from trihedron.api.identifying import recording_lengths
    from trihedron.report.noise import all_findings, noise_report
    from trihedron.report.noise_files import curve_csv, noise_record

    is_written = results.json is not None or results.report is not None
    lengths = recording_lengths(found, accuracy / 100.0) if results.full or is_written else None
    document = noise_report(found, lengths, accuracy / 100.0)
    results.show(document, FIRST_SCREEN)
    if csv is not None:
        write_whole(csv, curve_csv(found), overwrite=results.force)
        say(f"curve: {csv}")
    if plot is not None:
        from trihedron.report.noise import noise_picture
        from trihedron.report.presenting import png_of

        write_whole(plot, png_of(noise_picture(found)), overwrite=results.force)
        say(f"plot: {plot}")
    more = "Data-sheet units, how long to record, Kalibr's names: --full; curves: --plot F.png or --report F.html."
    results.write(document, lambda: noise_record(found, lengths, accuracy / 100.0), more)
    results.leave(all_findings(found))


def _of_log(source: LogSource, calibration: Path | None, options: dict[str, Any]) -> Noise:
    from trihedron.api.identifying import allan as identified

    recording = source.read()
    with progress("identifying"):
        return identified(recording, calibration=calibration, **options)


def _of_file(source: LogSource, options: dict[str, Any]) -> Noise:
    from trihedron.api.identifying import noise_of_file

    if source.log is None or source.columns is None or source.rate is None:
        raise typer.BadParameter("--stream needs LOG, --columns (as in gx,gy,gz,ax,ay,az) and --rate")
    with progress("identifying"):
        return noise_of_file(source.log, columns=source.columns, rate_hz=source.rate, **source.units, **options)


def _interval(text: str) -> tuple[float, float]:
    start, colon, stop = text.partition(":")
    try:
        if not colon or not (start or stop):
            raise ValueError
        return float(start or 0.0), float(stop or "inf")
    except ValueError:
        raise typer.BadParameter(
            f"--exclude is FROM:TO in seconds, as in 120:180, 3600: or :60, not {text!r}"
        ) from None
