"""mvsim: an IMU of a vehicle, ``reading = truth + b + N(0, white)``, ``b <- b + N(0, walk² dt)``; b starts at 0, no S.

By the documentation of its sensors and its class IMU, https://github.com/MRPT/mvsim.
"""

from __future__ import annotations

import math

from trihedron.files.formats.contract import ExportOptions, Format, number
from trihedron.files.formats.simulated import distortion, said_of
from trihedron.records import Calibration


def to_mvsim(calibration: Calibration, options: ExportOptions) -> str:
    """A ``<sensor>`` for a vehicle."""
    known, _, figures = distortion(calibration, options, "mvsim")
    both = ("accelerometer", "gyroscope")
    lost = ("Of the rate only its part about the vertical is simulated: the program's vehicles move in a plane.",)
    said = said_of(known, options, "reading = truth + walking bias + noise, SI.", lost_bias=both, lost=lost)
    root = math.sqrt(figures.rate_hz)
    lines = ["<!--", *(line.replace("--", "- -") for line in said), "-->", '<sensor class="imu" name="imu1">']
    lines.append(f"  <sensor_period>{number(1.0 / figures.rate_hz)}</sensor_period>")
    for word, N, K in (
        ("angular_velocity", figures.gyro_N, figures.gyro_K),
        ("linear_acceleration", figures.accel_N, figures.accel_K),
    ):
        lines.append(f"  <{word}_white_noise_std_noise>{number(N.value * root)}</{word}_white_noise_std_noise>")
        lines.append(f"  <{word}_random_walk_std_noise>{number(K.value)}</{word}_random_walk_std_noise>")
    return "\n".join([*lines, "</sensor>", ""])


FORMATS = (Format("mvsim", to_mvsim, in_si=True),)
