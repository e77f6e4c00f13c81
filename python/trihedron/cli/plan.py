"""``trihedron plan``."""

from __future__ import annotations

from typing import Annotated

import typer

from trihedron.cli.calibrate import numbers
from trihedron.cli.options import with_options
from trihedron.cli.output import Results


@with_options(results=Results)
def plan(
    *,
    turns: Annotated[
        str, typer.Option(metavar="LIST", help="Known turns about every axis, in degrees: '90,-90' or '1440,-1440'.")
    ] = "90,-90",
    turn_time: Annotated[float, typer.Option(metavar="S", help="How long a turn takes.")] = 2.0,
    pose_time: Annotated[
        float, typer.Option(metavar="S", help="Length of a pose, and of the stretch without rotation.")
    ] = 4.0,
    gyro_noise: Annotated[float, typer.Option(metavar="X", help="White noise of the gyro [deg/s/√Hz].")] = 0.005,
    accel_noise: Annotated[float, typer.Option(metavar="X", help="White noise of the accelerometer [µg/√Hz].")] = 150.0,
    turn_error: Annotated[float, typer.Option(metavar="DEG", help="Standard error of a turn's angle (wall).")] = 0.0,
    results: Results,
) -> None:
    """Before an experiment: expected uncertainties from turns, poses and moves, and which of them matter most."""
    results.check()
    from trihedron import units
    from trihedron.api.planning import plan as make_plan
    from trihedron.report.plan import plan_record, plan_report

    planned = make_plan(
        turns_deg=numbers("--turns", turns),
        turn_s=turn_time,
        pose_s=pose_time,
        gyroscope_density=units.radians_from_degrees(gyro_noise),
        accelerometer_density=units.m_s2_from_micro_g(accel_noise),
        sigma_turn_rad=units.radians_from_degrees(turn_error),
    )
    document = plan_report(planned)
    machine = plan_record(planned)
    results.tell(document, machine)
