"""``trihedron fleet``."""

from pathlib import Path

import typer

from trihedron.cli.options import GravitySource, progress, with_options
from trihedron.cli.output import NOT_TO_BE_TRUSTED, FullResults, say

OPTIONS = {
    "logs": typer.Argument(metavar="DIR|GLOB...", help="Folder with logs, pattern such as 'logs/*.csv', or logs."),
    "out": ("DIR", "Folder of the results; done logs in it are not redone.", "-o"),
    "scheduler": ("ADDRESS", "Dask scheduler, tcp://host:8786; a local cluster otherwise."),
    "workers": typer.Option(
        "--workers", metavar="N", min=0, help="Processes of the local cluster; 0 works here, without Dask."
    ),
    "serial": ("REGEX", "Its group names the device in a log's path, 'unit_(\\d+)'; else the folder is the device."),
    "no_diagnose": "Calibrate only: several times faster.",
    "columns": ("LIST", "As for the other commands, the same for all logs."),
    "rate": ("HZ", "Sampling rate of logs without a time column."),
    "accel_unit": ("UNIT", "Unit of all accelerometers."),
    "gyro_unit": ("UNIT", "Unit of all gyros."),
    "force": "Replace the --json file if it exists.",
}


@with_options(OPTIONS, place=GravitySource)
def fleet(
    place: GravitySource,
    logs: list[str],
    out: Path,
    scheduler: str | None = None,
    workers: int | None = None,
    serial: str | None = None,
    no_diagnose: bool = False,
    columns: str | None = None,
    rate: float | None = None,
    accel_unit: str | None = None,
    gyro_unit: str | None = None,
    json: Path | None = None,
    force: bool = False,
) -> None:
    """Calibrate and diagnose many logs of many devices: one table, one page."""
    FullResults(json, force=force).check()
    from trihedron.fleet import fleet as run
    from trihedron.report.fleet import fleet_report

    with progress("fleet") as notify:
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
            progress=notify,
        )
    document = fleet_report(result.summary)
    shown = tuple(section for section in document.sections if section.heading != "Every log")
    # The page again, with how it was made.
    results = FullResults(json, out / "fleet.html", force=True)
    results.show(document, len(shown))
    results.write(document, lambda: {"rows": list(result.rows)})
    say(f"table: {out / 'fleet.parquet'}, {out / 'fleet.csv'}")
    say(f"calibrations, for export, verify and apply: {out / 'calibrations'}")
    if document.level == "bad":
        raise typer.Exit(NOT_TO_BE_TRUSTED)
