"""Programs whose files hold an IMU's noise and rate, and nothing of S and b."""

from __future__ import annotations

from trihedron.files.formats.contract import ExportOptions, heading, of_si_readings
from trihedron.files.formats.losses import lost_without_intrinsics
from trihedron.files.formats.noise_keys import Figures, required
from trihedron.records import Calibration


def noise_alone(
    calibration: Calibration, options: ExportOptions, target: str, poses: str = ""
) -> tuple[Calibration, Figures, list[str]]:
    """The calibration of readings in SI, the figures that the target demands, and the comments that head its file.

    Raises
    ------
    ValueError
        When noise or rate are not known: a missing key would be read as zero.
    """
    known = of_si_readings(calibration, target, options)
    figures = required(known, options, target)
    said = heading(known, f"{target} has no intrinsics of the IMU{poses}.")
    return known, figures, [f"# {line}" for line in [*said, *lost_without_intrinsics(known)]]
