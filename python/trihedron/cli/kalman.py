"""``trihedron kalman``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from trihedron.cli.options import GravitySource, LogSource, progress, with_options
from trihedron.cli.output import Results, leave, say, show

FIRST_SCREEN = 3


@with_options(source=LogSource, place=GravitySource, results=Results)
def kalman(
    source: LogSource,
    place: GravitySource,
    *,
    reference: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Pose table with header: pitch,roll in degrees or fx,fy,fz; also pose, or start,stop. "
            "Without it the length of gravity is used.",
        ),
    ] = None,
    angle_sigma: Annotated[
        float, typer.Option(metavar="DEG", help="Standard error of the angles in the pose table.")
    ] = 0.0,
    noise: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="A static log to identify the noise from, or a JSON of Allan coefficients.",
        ),
    ] = None,
    frame: Annotated[str, typer.Option(help="Body frame without a pose table: lower or symmetric.")] = "lower",
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write the calibration file (JSON).")
    ] = None,
    full: Annotated[bool, typer.Option("--full", help="Print the whole report.")] = False,
    results: Results,
) -> None:
    """Calibrate the accelerometer by Kalman filter, pose by pose, with its noise in the state."""
    if frame not in ("lower", "symmetric"):
        raise typer.BadParameter(f"--frame is one of lower, symmetric, not {frame!r}")
    results.check(output, inputs=(*source.files, reference, noise))
    recording = source.read()
    from trihedron.api import filtering
    from trihedron.files.calibration import write_calibration
    from trihedron.report import kalman_report
    from trihedron.report.kalman import kalman_record

    options: dict[str, Any] = {"frame": frame, "noise": noise, "sigma_angle_deg": angle_sigma, **place.said}
    with progress("filtering") as tell:
        result = filtering.kalman(recording, reference, **options, progress=tell)
    document = kalman_report(result.outcome, result.calibration)
    machine = kalman_record(result.outcome, result.calibration)
    show(document, results.json, sections=None if full else FIRST_SCREEN)
    if output is not None:
        write_calibration(result.calibration, output, overwrite=results.force)
        say(f"calibration: {output}")
    results.write(document, machine)
    if not full and results.report is None:
        say("Every pose: --full; convergence, innovations and residuals drawn: --report FILE.html.")
    leave(result.findings)
