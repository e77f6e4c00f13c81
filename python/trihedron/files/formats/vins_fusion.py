"""Noise, topic and gravity for VINS-Fusion's configuration, which has no place for S and b."""

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


def to_vins_fusion(calibration: Calibration, options: ExportOptions) -> str:
    """The keys of the IMU; a missing one would be read as zero, so that noise is required.

    Raises
    ------
    ValueError
        When noise or rate are not known.
    """
    known = of_si_readings(calibration, "VINS-Fusion", options)
    figures = required(known, options, "VINS-Fusion")
    lines = ["%YAML:1.0", *(f"# {line}" for line in heading(known, "VINS-Fusion has no intrinsics of the IMU."))]
    lines += [f"# {line}" for line in lost_without_intrinsics(known)]
    lines += ["imu: 1", f'imu_topic: "{options.topic}"', *si_rows(figures, ("acc_n", "acc_w", "gyr_n", "gyr_w"))]
    return "\n".join([*lines, f"g_norm: {number(known.gravity_m_s2)}", ""])


FORMAT = Format("vins-fusion", to_vins_fusion, in_si=True)
