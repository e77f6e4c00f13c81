"""LIO-SAM's IMU noise: continuous densities, which it squares for GTSAM's preintegration; no fields for S and b."""

from __future__ import annotations

from trihedron.files.formats.contract import ExportOptions, Format, number
from trihedron.files.formats.matrices import noise_alone
from trihedron.files.formats.noise_keys import si_rows
from trihedron.records import Calibration


def to_lio_sam(calibration: Calibration, options: ExportOptions) -> str:
    """Keys of the IMU for ``params.yaml``."""
    known, figures, lines = noise_alone(calibration, options, "LIO-SAM")
    lines += [f"imuTopic: {options.topic}"]
    lines += si_rows(figures, ("imuAccNoise", "imuAccBiasN", "imuGyrNoise", "imuGyrBiasN"))
    return "\n".join([*lines, f"imuGravity: {number(known.gravity_m_s2)}", ""])


FORMAT = Format("lio-sam", to_lio_sam, in_si=True)
