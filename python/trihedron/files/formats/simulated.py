"""Shared by simulators: the distortion of truth to readings, and what their IMU model cannot represent."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.files.formats.contract import ExportOptions, heading, of_si_readings
from trihedron.files.formats.losses import has_bias, has_matrix, size_of_bias
from trihedron.files.formats.noise_keys import Figures, required
from trihedron.files.plausible import named_sensors
from trihedron.records import Calibration
from trihedron.sensor_model import other_form


def distortion(
    calibration: Calibration, options: ExportOptions, target: str
) -> tuple[Calibration, dict[str, tuple[FloatArray, FloatArray]], Figures]:
    """``reading = A truth + b`` by sensor, (3, 3) and (3,) in SI, and the noise; an ideal gyro where there is none.

    Refused when noise or rate are not given.
    """
    known = of_si_readings(calibration, target, options)
    pairs = {name: other_form(sensor.S, sensor.b) for name, sensor in named_sensors(known)}
    pairs.setdefault("gyroscope", (np.eye(3), np.zeros(3)))
    return known, pairs, required(known, options, target)


def said_of(
    calibration: Calibration,
    options: ExportOptions,
    equation: str,
    *,
    holds_matrix: bool = False,
    lost_bias: tuple[str, ...] = (),
    lost: tuple[str, ...] = (),
) -> list[str]:
    """Heading of a simulator's file, with what its model cannot represent and the size of that for this unit."""
    lines = heading(calibration, equation)
    for name, sensor in named_sensors(calibration):
        A, b = other_form(sensor.S, sensor.b)
        if not holds_matrix and has_matrix(sensor):
            share = 100.0 * float(np.linalg.norm(A - np.eye(3), 2))
            lines.append(f"Scale and misalignment of the {name} cannot be held: {share:.2g} % of its signal is lost.")
        if name in lost_bias and has_bias(sensor):
            lines.append(f"The bias of the {name} cannot be held: {size_of_bias(name, b)} is lost.")
    lines += lost
    for name, noise in (("accelerometer", options.accelerometer_noise), ("gyroscope", options.gyroscope_noise)):
        if noise is not None and noise.K.is_limit:
            lines.append(f"The {name}'s walk is an upper limit: it was not seen in the static log.")
    return lines
