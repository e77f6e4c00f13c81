"""What targets with a lower-triangular accelerometer share."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.files.formats.contract import ExportOptions, of_si_readings
from trihedron.records import Calibration
from trihedron.sensor_model import in_frame, other_form


def in_lower(
    calibration: Calibration, target: str, options: ExportOptions
) -> tuple[Calibration, FloatArray, FloatArray]:
    """The calibration of SI readings in the lower-triangular frame, and the accelerometer's inverse form."""
    lower = in_frame(calibration, "lower") if calibration.frame != "lower" else calibration
    lower = of_si_readings(lower, target, options)
    M, b = other_form(lower.accelerometer.S, lower.accelerometer.b)
    return lower, np.tril(M), b
