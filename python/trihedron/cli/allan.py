"""``trihedron allan``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from trihedron.cli.options import LogSource, progress, with_options
from trihedron.cli.output import Results, leave, say, show
from trihedron.cli.streamed import Kept, needs_stream
from trihedron.files.output import write_whole

if TYPE_CHECKING:
    from trihedron.records import Noise

FIRST_SCREEN = 2


GyroLsb = Annotated[
    str | None, typer.Option("--gyro-lsb", metavar="SIZE", help="Size of the gyro's count, as in '0.05 deg/s'.")
]
AccelLsb = Annotated[
    str | None, typer.Option("--accel-lsb", metavar="SIZE", help="Size of the accelerometer's count, as in '3.33 mg'.")
]
Of = Annotated[
    Path | None,
    typer.Option("--calibration", metavar="FILE", help="Calibration of the unit: it gives the size of a count."),
]
Exclude = Annotated[
    list[str] | None,
    typer.Option(
        "--exclude",
        metavar="FROM:TO",
        help="Leave out this stretch [s]; :TO from the start, FROM: to the end; may be given more than once.",
    ),
]
KeepEvents = Annotated[
    bool, typer.Option("--keep-events", help="Exclude nothing automatically: knocks, vibration and steps stay in.")
]
Accuracy = Annotated[
    float,
    typer.Option("--accuracy", metavar="PERCENT", help="How long to record for this uncertainty of each term; --full."),
]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE.png", help="Draw the Allan curves (also in the report)."),
]
Csv = Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Write the Allan curve as a table.")]
Curve = Annotated[
    bool,
    typer.Option(
        "--curve", help="LOG is a table of Allan deviations (--csv of another run, or published): terms from it."
    ),
]
Samples = Annotated[
    int | None,
    typer.Option("--samples", metavar="N", help="Readings of the log behind --curve, where the table is silent."),
]
Stream = Annotated[
    bool,
    typer.Option(
        "--stream",
        help="Read a .npy, Parquet or CSV log in pieces, in at most 1.5 GB and without audit: --columns, "
        "--rate and the units state what it holds.",
    ),
]
Full = Annotated[
    bool, typer.Option("--full", help="Print customary units, how long to record and Kalibr's names as well.")
]


@with_options(source=LogSource, results=Results)
def allan(
    source: LogSource,
    *,
    gyro_lsb: GyroLsb = None,
    accel_lsb: AccelLsb = None,
    calibration: Of = None,
    exclude: Exclude = None,
    keep_events: KeepEvents = False,
    accuracy: Accuracy = 10.0,
    plot: Plot = None,
    csv: Csv = None,
    curve: Curve = False,
    samples: Samples = None,
    stream: Stream = False,
    checkpoint: Kept = None,
    full: Full = False,
    results: Results,
) -> None:
    """Identify the noise terms of a long static log: how large, how certain, how long to average."""
    stretches = [_stretch(text) for text in exclude or []]
    if not 0.0 < accuracy < 1000.0:
        raise typer.BadParameter(f"--accuracy is a positive number of per cent, not {accuracy:g}")
    results.check(csv, plot, inputs=(*source.files, calibration))
    if calibration is not None and (curve or stream):
        raise typer.BadParameter("--calibration goes with a log that is read whole: no --curve, no --stream")
    needs_stream(checkpoint, stream=stream)
    if curve:
        if exclude or stream or keep_events:
            raise typer.BadParameter("--curve has no log: --exclude, --keep-events and --stream do not go with it")
        found = _of_curve(source, samples, gyro_lsb, accel_lsb)
    else:
        options = {"exclude_s": stretches, "automatic": not keep_events}
        found = _of_log(
            source,
            stream=stream,
            checkpoint=checkpoint,
            calibration=calibration,
            options=options | {"gyroscope_lsb": gyro_lsb, "accelerometer_lsb": accel_lsb},
        )
    from trihedron.api.identifying import recording_lengths
    from trihedron.report.noise import all_findings, noise_report
    from trihedron.report.noise_files import curve_csv, noise_record

    is_written = results.json is not None or results.report is not None
    lengths = recording_lengths(found, accuracy / 100.0) if full or is_written else None
    document = noise_report(found, lengths, accuracy / 100.0)
    machine = noise_record(found, lengths, accuracy / 100.0) if is_written else {}
    show(document, results.json, sections=None if full else FIRST_SCREEN)
    if csv is not None:
        write_whole(csv, curve_csv(found), overwrite=results.force)
        say(f"curve: {csv}")
    if plot is not None:
        from trihedron.report.drawing import png_of
        from trihedron.report.noise import noise_picture

        write_whole(plot, png_of(noise_picture(found)), overwrite=results.force)
        say(f"plot: {plot}")
    results.write(document, machine)
    if not full and results.report is None:
        say("Data-sheet units, how long to record, Kalibr's names: --full; curves: --plot F.png or --report F.html.")
    leave(all_findings(found))


def _of_log(
    source: LogSource, *, stream: bool, checkpoint: Path | None, calibration: Path | None, options: dict[str, Any]
) -> Noise:
    from trihedron.api import identifying

    if not stream:
        recording = source.read()
        with progress("identifying"):
            return identifying.allan(recording, calibration=calibration, **options)
    if source.log is None or source.columns is None or source.rate is None:
        raise typer.BadParameter("--stream needs LOG, --columns (as in gx,gy,gz,ax,ay,az) and --rate")
    with progress("identifying"):
        return identifying.noise_of_file(
            source.log,
            columns=source.columns,
            rate_hz=source.rate,
            accelerometer_unit=source.accel_unit,
            gyroscope_unit=source.gyro_unit,
            checkpoint=checkpoint,
            **options,
        )


def _of_curve(source: LogSource, samples: int | None, gyro_lsb: str | None, accel_lsb: str | None) -> Noise:
    from trihedron.api import identifying

    if source.log is None:
        raise typer.BadParameter("--curve needs the table in the place of LOG")
    if gyro_lsb or accel_lsb:
        raise typer.BadParameter("--curve has no counts: say the unit of the deviations with --gyro-unit, --accel-unit")
    with progress("identifying"):
        return identifying.noise_of_curve(
            source.log,
            rate_hz=source.rate,
            n_samples=samples,
            accelerometer_unit=source.accel_unit,
            gyroscope_unit=source.gyro_unit,
        )


def _stretch(text: str) -> tuple[float, float]:
    start, colon, stop = text.partition(":")
    try:
        if not colon or not (start or stop):
            raise ValueError
        return float(start or 0.0), float(stop or "inf")
    except ValueError:
        raise typer.BadParameter(
            f"--exclude is FROM:TO in seconds, as in 120:180, 3600: or :60, not {text!r}"
        ) from None
