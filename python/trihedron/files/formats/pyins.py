"""pyins: ``x_out = T x + b``, true → measured, T a full matrix."""

import re

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, given, heading
from trihedron.files.formats.from_templates import NONE, filled
from trihedron.files.formats.parsing import numbers_in
from trihedron.records import Calibration
from trihedron.sensor_model import other_form


def to_pyins(calibration: Calibration, _options: ExportOptions) -> str:
    """Arrays for ``pyins.inertial_sensor.Parameters``."""
    equation = "x_out = T x + b: true to measured, the inverse of the direct form."
    named = zip(calibration.sensors, ("accel", "gyro"), strict=False)
    sensors = [(name, *other_form(sensor.S, sensor.b)) for (_, sensor), name in named]
    return filled("pyins", NONE, said=heading(calibration, equation), sensors=sensors)


def from_pyins(text: str) -> Calibration | None:
    """The arrays that :func:`to_pyins` writes."""
    sensors = {}
    for name, short in (("accelerometer", "accel"), ("gyroscope", "gyro")):
        parts = [re.search(rf"^{short}_{part} = np\.array\((.*)\)$", text, re.M) for part in ("transform", "bias")]
        values = [numbers_in(part[1]) for part in parts if part is not None]
        if [len(v) for v in values] == [9, 3]:
            sensors[name] = other_form(np.array(values[0]).reshape(3, 3), np.array(values[1]))
    return given("pyins", sensors) if "accelerometer" in sensors else None


FORMATS = (Format("pyins", to_pyins, from_pyins),)
