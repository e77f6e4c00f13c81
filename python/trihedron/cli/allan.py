"""``trihedron allan``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Optional

import typer

from trihedron.cli.options import Force, Json, LogSource, Report, progress, with_options
from trihedron.cli.output import check_outputs, leave, say, show, write_json, write_report
from trihedron.output_file import write_whole

FIRST_SCREEN = 2


@with_options(source=LogSource)
def allan(
    source: LogSource,
    exclude: Annotated[
        Optional[list[str]],  # noqa: UP045 -- typer evaluates it at run time
        typer.Option("--exclude", metavar="FROM:TO", help="Leave out this stretch [s]; may be given more than once."),
    ] = None,
    keep_events: Annotated[
        bool, typer.Option("--keep-events", help="Leave nothing out by itself: knocks, shaking and steps stay in.")
    ] = False,
    plot: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--plot", metavar="FILE.png", help="Draw the Allan curves (the report holds them as well)."),
    ] = None,
    csv: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--csv", metavar="FILE", help="Write the Allan curve as a table."),
    ] = None,
    stream: Annotated[
        bool,
        typer.Option(
            "--stream",
            help="Map or read a .npy or Parquet log in pieces, in bounded memory and without audit: --columns, "
            "--rate and the units say what it holds.",
        ),
    ] = False,
    json: Json = None,
    report: Report = None,
    full: Annotated[bool, typer.Option("--full", help="Print the customary units and Kalibr's names as well.")] = False,
    force: Force = False,
) -> None:
    """Identify the noise terms of a long static log: how large, how certain, how long to average."""
    stretches = [_stretch(text) for text in exclude or []]
    check_outputs(json, csv, plot, force=force, report=report)
    options: dict[str, Any] = {"exclude_s": stretches, "automatic": not keep_events}
    from trihedron import pipeline

    if stream:
        if source.log is None or source.columns is None or source.rate is None:
            raise typer.BadParameter("--stream needs LOG, --columns (as in gx,gy,gz,ax,ay,az) and --rate")
        with progress("identifying"):
            found = pipeline.noise_of_file(
                source.log,
                columns=source.columns,
                rate_hz=source.rate,
                accelerometer_unit=source.accel_unit,
                gyroscope_unit=source.gyro_unit,
                **options,
            )
    else:
        recording = source.read()
        with progress("identifying"):
            found = pipeline.noise(recording, **options)
    from trihedron.report.noise import all_findings, curve_csv, noise_record, noise_report

    document = noise_report(found)
    machine = noise_record(found) if json is not None or report is not None else {}
    show(document, json, sections=None if full else FIRST_SCREEN)
    if csv is not None:
        write_whole(csv, curve_csv(found), overwrite=force)
        say(f"curve: {csv}")
    if plot is not None:
        from trihedron.report.noise import draw_noise

        write_whole(plot, draw_noise(found), overwrite=force)
        say(f"plot: {plot}")
    write_json(machine, json, force=force)
    write_report(document, machine, report, force=force)
    if not full and report is None:
        say("Customary units and Kalibr's names: --full; the curves: --plot FILE.png or --report FILE.html.")
    leave(all_findings(found))


def _stretch(text: str) -> tuple[float, float]:
    start, colon, stop = text.partition(":")
    try:
        return float(start), float(stop) if colon else float("nan")
    except ValueError:
        raise typer.BadParameter(f"--exclude is FROM:TO in seconds, as in 120:180, not {text!r}") from None
