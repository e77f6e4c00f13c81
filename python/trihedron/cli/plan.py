"""``trihedron plan``."""

from trihedron.cli.options import numbers, with_options
from trihedron.cli.output import Results

OPTIONS = {
    "turns": ("LIST", "Known turns about every axis, in degrees: '90,-90' or '1440,-1440'."),
    "turn_time": ("S", "How long a turn takes."),
    "pose_time": ("S", "Length of a pose, and of the interval without rotation."),
    "gyro_noise": ("X", "White noise of the gyro [deg/s/√Hz]."),
    "accel_noise": ("X", "White noise of the accelerometer [µg/√Hz]."),
    "turn_error": ("DEG", "Standard error of a turn's angle (wall)."),
}


@with_options(OPTIONS, results=Results)
def plan(
    *,
    turns: str = "90,-90",
    turn_time: float = 2.0,
    pose_time: float = 4.0,
    gyro_noise: float = 0.005,
    accel_noise: float = 150.0,
    turn_error: float = 0.0,
    results: Results,
) -> None:
    """Before an experiment: expected uncertainties from turns, poses and moves, and which of them matter most."""
    results.check()
    from trihedron import units
    from trihedron.api.planning import plan as make_plan

    planned = make_plan(
        turns_deg=numbers("--turns", turns),
        turn_s=turn_time,
        pose_s=pose_time,
        gyroscope_density=units.radians_from_degrees(gyro_noise),
        accelerometer_density=units.m_s2_from_micro_g(accel_noise),
        sigma_turn_rad=units.radians_from_degrees(turn_error),
    )
    results.emit(planned)
