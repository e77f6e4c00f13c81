"""MATLAB's ``imuSensor``: ``reading = AxesMisalignment/100 · truth + ConstantBias``, white noise, random walk.

White noise is ``NoiseDensity √rate`` per sample and the walk ``RandomWalk/√rate`` per step, for the double-sided noise
type. By the algorithms on MathWorks' page of imuSensor.
"""

from __future__ import annotations

from trihedron.files.formats.contract import ExportOptions, Format, number, row
from trihedron.files.formats.simulated import distortion, said_of
from trihedron.records import Calibration


def to_imusensor(calibration: Calibration, options: ExportOptions) -> str:
    """A MATLAB script that creates the object ``imu``."""
    known, pairs, figures = distortion(calibration, options, "imuSensor")
    equation = "reading = AxesMisalignment/100 * truth + ConstantBias + noise, SI."
    lines = [f"% {line}" for line in said_of(known, options, equation, holds_matrix=True)]
    lines += [f"imu = imuSensor('accel-gyro', 'SampleRate', {number(figures.rate_hz)});"]
    for attribute, make, name, N, K in (
        ("Accelerometer", "accelparams", "accelerometer", figures.accel_N, figures.accel_K),
        ("Gyroscope", "gyroparams", "gyroscope", figures.gyro_N, figures.gyro_K),
    ):
        A, b = pairs[name]
        rows = "; ".join(row(100.0 * r).replace(",", "") for r in A)
        lines += [
            f"imu.{attribute} = {make}( ...",
            f"    'AxesMisalignment', [{rows}], ...",
            f"    'ConstantBias', [{row(b).replace(',', '')}], ...",
            "    'NoiseType', 'double-sided', ...",
            f"    'NoiseDensity', {number(N.value)}, ...",
            f"    'RandomWalk', {number(K.value)});",
        ]
    return "\n".join([*lines, ""])


FORMATS = (Format("imusensor", to_imusensor, in_si=True),)
