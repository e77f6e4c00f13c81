"""``trihedron verify``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from trihedron.cli.options import Force, GravitySource, Json, LogSource, Report, progress, with_options
from trihedron.cli.output import check_outputs, leave, say, show, write_json, write_report

FIRST_SCREEN = 2


@with_options(source=LogSource, place=GravitySource)
def verify(
    calibration: Annotated[Path, typer.Argument(metavar="CALIBRATION", help="Calibration file (JSON).")],
    source: LogSource,
    place: GravitySource,
    limit_mg: Annotated[
        Optional[float],  # noqa: UP045 -- typer evaluates it at run time
        typer.Option(
            metavar="MG", help="Largest rms error of gravity at rest that you accept; beyond it the exit status is 2."
        ),
    ] = None,
    limit_deg: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(metavar="DEG", help="The same for gravity carried through the moves by the gyro."),
    ] = None,
    json: Json = None,
    report: Report = None,
    full: Annotated[bool, typer.Option("--full", help="Print the whole report, with every pose and move.")] = False,
    force: Force = False,
) -> None:
    """Test a calibration on another recording.

    Exit status 2 when a limit is exceeded, or, without one, when the miss is more than ten times what was expected.
    """
    check_outputs(json, force=force, report=report, inputs=(*source.files, calibration))
    from trihedron.files.calibration import read_calibration

    known = read_calibration(calibration)
    recording = source.read()
    from trihedron import pipeline
    from trihedron.report import verification_report
    from trihedron.report.machine import verification_record

    with progress("verifying") as tell:
        result = pipeline.verify(
            known,
            recording,
            gravity_m_s2=place.gravity,
            latitude_deg=place.latitude,
            height_m=place.height,
            limit_mg=limit_mg,
            limit_deg=limit_deg,
            progress=tell,
        )
    document = verification_report(result.verification, result.segments, recording)
    machine = verification_record(result.verification)
    show(document, json, sections=None if full else FIRST_SCREEN)
    write_json(machine, json, force=force)
    write_report(document, machine, report, force=force)
    if not full and report is None:
        say("Every pose and move: --full, or --report FILE.html with figures.")
    leave(result.findings)
