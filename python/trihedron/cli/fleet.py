"""``trihedron fleet``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from trihedron.cli.options import GravitySource, Json, progress, with_options
from trihedron.cli.output import check_outputs, say, show, write_json

NOT_TO_BE_TRUSTED = 2


@with_options(place=GravitySource)
def fleet(
    place: GravitySource,
    logs: Annotated[
        list[str],
        typer.Argument(metavar="DIR|GLOB...", help="Folder with logs, pattern such as 'logs/*.csv', or logs."),
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder of the results; done logs in it are not redone.")
    ],
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler, tcp://host:8786; a local cluster otherwise.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(metavar="N", min=0, help="Processes of the local cluster; 0 works here, without Dask.")
    ] = None,
    serial: Annotated[
        str | None,
        typer.Option(
            metavar="REGEX",
            help="Its group names the device in a log's path, 'unit_(\\d+)'; else the folder is the device.",
        ),
    ] = None,
    no_diagnose: Annotated[bool, typer.Option("--no-diagnose", help="Calibrate only: several times faster.")] = False,
    columns: Annotated[
        str | None, typer.Option(metavar="LIST", help="As for the other commands, the same for all logs.")
    ] = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Sampling rate of logs without a time column.")
    ] = None,
    accel_unit: Annotated[str | None, typer.Option(metavar="UNIT", help="Unit of all accelerometers.")] = None,
    gyro_unit: Annotated[str | None, typer.Option(metavar="UNIT", help="Unit of all gyros.")] = None,
    json: Json = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the --json file if it exists.")] = False,
) -> None:
    """Calibrate and diagnose many logs of many devices: one table, one page."""
    check_outputs(json, force=force)
    from trihedron.fleet import fleet as run
    from trihedron.report.fleet import fleet_report

    with progress("fleet") as tell:
        result = run(
            logs[0] if len(logs) == 1 else list(logs),
            out,
            scheduler=scheduler,
            workers=workers,
            diagnose=not no_diagnose,
            serial=serial,
            **place.said,
            columns=columns,
            rate_hz=rate,
            accelerometer_unit=accel_unit,
            gyroscope_unit=gyro_unit,
            progress=tell,
        )
    document = fleet_report(result.summary)
    shown = tuple(section for section in document.sections if section.heading != "Every log")
    show(document, json, sections=len(shown))
    write_json({"rows": list(result.rows)}, json, force=force, document=document)
    say(f"table: {out / 'fleet.parquet'}, {out / 'fleet.csv'}; page: {out / 'fleet.html'}")
    say(f"calibrations, for export, verify and apply: {out / 'calibrations'}")
    if not document.is_trustworthy:
        raise typer.Exit(NOT_TO_BE_TRUSTED)
