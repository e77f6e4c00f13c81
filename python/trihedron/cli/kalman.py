"""``trihedron kalman``."""

from pathlib import Path
from typing import Any

from trihedron.cli.options import GravitySource, LogSource, one_of, progress, with_options
from trihedron.cli.output import FullResults

OPTIONS = {
    "reference": (
        "FILE",
        "Pose table with header: pitch,roll in degrees or fx,fy,fz; also pose, or start,stop. "
        "Without it the length of gravity is used.",
    ),
    "angle_sigma": ("DEG", "Standard error of the angles in the pose table."),
    "noise": ("FILE", "A static log, the JSON that trihedron allan writes of one, or a JSON of Allan coefficients."),
    "frame": (
        "NAME",
        "Body frame without a pose table: lower (lower-triangular, X along accelerometer X) or symmetric.",
    ),
    "full": "Print the whole report.",
}


@with_options(OPTIONS, source=LogSource, place=GravitySource, results=FullResults)
def kalman(
    source: LogSource,
    place: GravitySource,
    *,
    reference: Path | None = None,
    angle_sigma: float = 0.0,
    noise: Path | None = None,
    frame: str = "lower",
    output: Path | None = None,
    results: FullResults,
) -> None:
    """Calibrate the accelerometer by Kalman filter, pose by pose, with its noise in the state."""
    options: dict[str, Any] = {"frame": one_of("--frame", frame, ("lower", "symmetric")), "noise": noise}
    results.check(output, inputs=(*source.files, reference, noise))
    recording = source.read()
    from trihedron.api import filtering

    with progress("filtering") as notify:
        result = filtering.kalman(
            recording, reference, sigma_angle_deg=angle_sigma, **options, **place.said, progress=notify
        )
    results.emit(result, "Every pose: --full; innovations drawn: --report FILE.html.", sections=3, output=output)
