"""Noise, topic and gravity for VINS-Fusion's configuration, which has no fields for S and b."""

from __future__ import annotations

from trihedron.files.formats.contract import ExportOptions, Format, number
from trihedron.files.formats.matrices import noise_alone
from trihedron.files.formats.noise_keys import si_rows
from trihedron.records import Calibration


def to_vins_fusion(calibration: Calibration, options: ExportOptions) -> str:
    """The keys of the IMU."""
    known, figures, lines = noise_alone(calibration, options, "VINS-Fusion")
    lines += ["imu: 1", f'imu_topic: "{options.topic}"', *si_rows(figures, ("acc_n", "acc_w", "gyr_n", "gyr_w"))]
    return "\n".join(["%YAML:1.0", *lines, f"g_norm: {number(known.gravity_m_s2)}", ""])


FORMAT = Format("vins-fusion", to_vins_fusion, in_si=True)
