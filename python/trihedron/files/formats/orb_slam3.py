"""ORB-SLAM3's settings of an inertial sensor: densities in SI and rate; no fields for S and b."""

from __future__ import annotations

from trihedron.files.formats.contract import ExportOptions, Format, number
from trihedron.files.formats.matrices import noise_alone
from trihedron.files.formats.noise_keys import si_rows
from trihedron.records import Calibration


def to_orb_slam3(calibration: Calibration, options: ExportOptions) -> str:
    """Keys of the IMU for its settings file."""
    _, figures, lines = noise_alone(calibration, options, "ORB-SLAM3")
    lines += si_rows(figures, ("IMU.NoiseAcc", "IMU.AccWalk", "IMU.NoiseGyro", "IMU.GyroWalk"))
    return "\n".join(["%YAML:1.0", *lines, f"IMU.Frequency: {number(figures.rate_hz)}", ""])


FORMAT = Format("orb-slam3", to_orb_slam3, in_si=True)
