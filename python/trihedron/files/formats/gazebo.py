"""Gazebo: an SDF ``<imu>`` with Gaussian noise and bias drift, axis by axis.

Every sample adds ``N(mean, stddev)`` and a bias that follows ``b <- exp(-dt/tau) b + N(0, s)`` with
``s² = σ² tau/2 (1 - exp(-2 dt/tau))``: for tau much longer than a run, a random walk with σ = K. The bias of a unit
is written as ``mean``, because the sign of ``bias_mean`` is drawn. By GaussianNoiseModel of gz-sensors and the noise
element of SDFormat (https://github.com/gazebosim/gz-sensors).
"""

from __future__ import annotations

import math

from trihedron.arrays import AXES
from trihedron.files.formats.contract import ExportOptions, Format, number
from trihedron.files.formats.simulated import distortion, said_of
from trihedron.records import Calibration

CORRELATION_S = 1e6
"""Eleven days, longer than any run, so that the bias is a random walk."""


def to_gazebo(calibration: Calibration, options: ExportOptions) -> str:
    """A ``<sensor>`` for a link of an SDF model."""
    known, pairs, figures = distortion(calibration, options, "Gazebo")
    equation = "reading = truth + N(mean, stddev) + slow bias, axis by axis, SI."
    root = math.sqrt(figures.rate_hz)
    lines = ["<!--", *(line.replace("--", "- -") for line in said_of(known, options, equation)), "-->"]
    lines += ['<sensor name="imu" type="imu">', f"  <update_rate>{number(figures.rate_hz)}</update_rate>"]
    lines += [f"  <topic>{options.topic.strip('/')}</topic>", "  <imu>"]
    for element, name, N, K in (
        ("angular_velocity", "gyroscope", figures.gyro_N, figures.gyro_K),
        ("linear_acceleration", "accelerometer", figures.accel_N, figures.accel_K),
    ):
        lines.append(f"    <{element}>")
        for axis, bias in zip(AXES, pairs[name][1], strict=True):
            lines += [
                f'      <{axis}><noise type="gaussian">',
                f"        <mean>{number(float(bias))}</mean>",
                f"        <stddev>{number(N.value * root)}</stddev>",
                f"        <dynamic_bias_stddev>{number(K.value)}</dynamic_bias_stddev>",
                f"        <dynamic_bias_correlation_time>{number(CORRELATION_S)}</dynamic_bias_correlation_time>",
                f"      </noise></{axis}>",
            ]
        lines.append(f"    </{element}>")
    return "\n".join([*lines, "  </imu>", "</sensor>", ""])


FORMATS = (Format("gazebo", to_gazebo, in_si=True),)
