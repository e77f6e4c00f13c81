"""ORB-SLAM3's settings of an inertial sensor: densities in SI, rate; no place for S and b."""

from __future__ import annotations

from trihedron.files.formats.contract import (
    ExportOptions,
    Format,
    heading,
    lost_without_intrinsics,
    number,
    of_si_readings,
)
from trihedron.files.formats.noise_keys import required, si_rows
from trihedron.records import Calibration


def to_orb_slam3(calibration: Calibration, options: ExportOptions) -> str:
    """Keys of the IMU for its settings file."""
    known = of_si_readings(calibration, "ORB-SLAM3", options)
    figures = required(known, options, "ORB-SLAM3")
    lines = ["%YAML:1.0", *(f"# {line}" for line in heading(known, "ORB-SLAM3 has no intrinsics of the IMU."))]
    lines += [f"# {line}" for line in lost_without_intrinsics(known)]
    lines += si_rows(figures, ("IMU.NoiseAcc", "IMU.AccWalk", "IMU.NoiseGyro", "IMU.GyroWalk"))
    return "\n".join([*lines, f"IMU.Frequency: {number(figures.rate_hz)}", ""])


FORMAT = Format("orb-slam3", to_orb_slam3, in_si=True)
