"""FAST-LIO's covariances of one sample, ``N² rate`` and ``K² rate``, because its filter squares the time step.

Its prediction adds ``(dt F) Q (dt F)ᵀ``: white noise of density N adds N² dt to the variance of the angle, a random
walk K adds K² dt to that of the bias.
"""

from __future__ import annotations

from trihedron.files.formats.contract import ExportOptions, Format, number
from trihedron.files.formats.matrices import noise_alone
from trihedron.files.formats.noise_keys import limits
from trihedron.records import Calibration


def to_fast_lio(calibration: Calibration, options: ExportOptions) -> str:
    """Keys of the IMU for its configuration's ``mapping``."""
    _, figures, lines = noise_alone(calibration, options, "FAST-LIO", ": variances of one sample")
    lines += [f"# {limit}" for limit in limits(options)]
    lines += ["common:", f'  imu_topic: "{options.topic}"', "mapping:"]
    for key, one in (
        ("acc_cov", figures.accel_N),
        ("gyr_cov", figures.gyro_N),
        ("b_acc_cov", figures.accel_K),
        ("b_gyr_cov", figures.gyro_K),
    ):
        lines.append(f"  {key}: {number(one.value**2 * figures.rate_hz)}")
    return "\n".join([*lines, ""])


FORMAT = Format("fast-lio", to_fast_lio, in_si=True)
