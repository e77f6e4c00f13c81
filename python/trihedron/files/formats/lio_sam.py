"""LIO-SAM's noise of the IMU: continuous densities that it squares for GTSAM's preintegration; no place for S and b."""

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


def to_lio_sam(calibration: Calibration, options: ExportOptions) -> str:
    """Keys of the IMU for ``params.yaml``."""
    known = of_si_readings(calibration, "LIO-SAM", options)
    figures = required(known, options, "LIO-SAM")
    lines = [f"# {line}" for line in heading(known, "LIO-SAM has no intrinsics of the IMU.")]
    lines += [f"# {line}" for line in lost_without_intrinsics(known)]
    lines += [f"imuTopic: {options.topic}"]
    lines += si_rows(figures, ("imuAccNoise", "imuAccBiasN", "imuGyrNoise", "imuGyrBiasN"))
    return "\n".join([*lines, f"imuGravity: {number(known.gravity_m_s2)}", ""])


FORMAT = Format("lio-sam", to_lio_sam, in_si=True)
