"""gnss-ins-sim: the dictionary of an IMU, in deg/h, deg/√h, m/s² and m/s/√h.

Its bias follows ``b <- (1 - dt/tau) b + dt drift N(0, 1)`` per sample, so a random walk K needs ``drift = K √rate``:
the value is valid only at the rate of this file. By pathgen and imu_model of https://github.com/Aceinna/gnss-ins-sim.
"""

from __future__ import annotations

import math

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, number, row
from trihedron.files.formats.simulated import distortion, said_of
from trihedron.records import Calibration
from trihedron.units import degrees_from_radians

CORRELATION_S = 1e6
"""Eleven days, longer than any run, so that the bias is a random walk."""


def to_gnss_ins_sim(calibration: Calibration, options: ExportOptions) -> str:
    """A Python module with ``imu_err`` for ``imu_model.IMU(accuracy=imu_err)``."""
    known, pairs, figures = distortion(calibration, options, "gnss-ins-sim")
    lost = (f"The walk of the bias holds at {figures.rate_hz:g} Hz: the program scales it by the step.",)
    lines = [f"# {line}" for line in said_of(known, options, "reading = truth + b + slow bias + noise.", lost=lost)]
    lines += ["import numpy as np", "", f"FS = {number(figures.rate_hz)}", "imu_err = {"]
    root, hour = math.sqrt(figures.rate_hz), 3600.0
    per_hour = degrees_from_radians(1.0) * hour
    ones = np.ones(3)
    values = {
        "gyro_b": pairs["gyroscope"][1] * per_hour,
        "gyro_arw": ones * (degrees_from_radians(figures.gyro_N.value) * math.sqrt(hour)),
        "gyro_b_stability": ones * (figures.gyro_K.value * root * per_hour),
        "gyro_b_corr": ones * CORRELATION_S,
        "accel_b": pairs["accelerometer"][1],
        "accel_vrw": ones * (figures.accel_N.value * math.sqrt(hour)),
        "accel_b_stability": ones * (figures.accel_K.value * root),
        "accel_b_corr": ones * CORRELATION_S,
    }
    lines += [f"    {key!r}: np.array([{row(value)}])," for key, value in values.items()]
    return "\n".join([*lines, "}", ""])


FORMATS = (Format("gnss-ins-sim", to_gnss_ins_sim, in_si=True),)
