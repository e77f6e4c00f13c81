"""S and b as functions of temperature, from a calibration of several recordings `--by temperature`."""

from typing import Any

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.invariants import Anchor, model_vector, numbers_of
from trihedron.records import Calibration
from trihedron.records.sessions import PARAMETERS
from trihedron.sensor_model import in_frame, reframing


def parameters_at(calibration: Calibration, degc: float) -> FloatArray:
    """(12,) or (24,) S row by row, then b, of each sensor at one temperature [°C], in the calibration's frame.

    The polynomials are ``calibration.extensions["thermal"]`` (docs/calibration-file.md).
    """
    thermal: Any = calibration.extensions["thermal"]
    signs = np.array(thermal["axis_signs"], dtype=np.float64)
    triad = None if thermal.get("triad") is None else np.array(thermal["triad"], dtype=np.float64)
    anchor = Anchor(signs, triad)
    base = in_frame(calibration, "lower")
    accel, gyro = base.accelerometer, base.gyroscope
    numbers = numbers_of(accel.S, accel.b, None if gyro is None else gyro.S, None if gyro is None else gyro.b, anchor)
    t = degc - float(thermal["reference_degc"])
    for term in thermal["terms"]:
        picked = [k for k, parameter in enumerate(PARAMETERS[: len(numbers)]) if parameter.id == term["id"]]
        if picked:
            coefficients = np.array(term["coefficients"], dtype=np.float64)
            numbers[picked] += (t ** np.arange(1, len(coefficients))) @ coefficients[1:]
    parameters = model_vector(numbers, anchor)
    if calibration.frame != "lower":
        # The frame is defined by the axes at this temperature, as at the reference temperature.
        turn = reframing(parameters[:9].reshape(3, 3), parameters[9:12], calibration.frame).rotation
        for first in range(0, len(parameters), 12):
            parameters[first : first + 9] = (turn @ parameters[first : first + 9].reshape(3, 3)).ravel()
            parameters[first + 9 : first + 12] = turn @ parameters[first + 9 : first + 12]
    return parameters
