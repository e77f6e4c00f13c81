"""xio Fusion and x-IMU3: ``M (s ∘ (raw - b))`` to g and degrees per second, M with unit diagonal."""

import re

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, given, heading
from trihedron.files.formats.from_templates import NONE, filled
from trihedron.files.formats.parsing import numbers_in
from trihedron.records import Calibration
from trihedron.units import STANDARD_GRAVITY_M_S2, degrees_from_radians

_PARTS = ("Misalignment", "Sensitivity", "Offset")
_TO_SI = {"accelerometer": STANDARD_GRAVITY_M_S2, "gyroscope": 1.0 / degrees_from_radians(1.0)}


def to_xio(calibration: Calibration, _options: ExportOptions) -> str:
    """Arrays in C for Fusion's functions."""
    equation = "corrected = misalignment * (sensitivity o (raw - offset)), in the units that Fusion expects."
    sensors = []
    for name, sensor in calibration.sensors:
        S = sensor.S / _TO_SI[name]
        scale = np.diag(S)
        sensors.append((name, S / scale, scale, -np.linalg.solve(sensor.S, sensor.b)))
    return filled("xio", NONE, said=heading(calibration, equation, corrected_in="g, deg/s"), sensors=sensors)


def from_xio(text: str) -> Calibration | None:
    """Reads arrays in C, or the same names as keys of a device's settings (``accelerometerMisalignment``: [...])."""
    sensors = {}
    for name in ("accelerometer", "gyroscope"):
        parts = []
        for part in _PARTS:
            found = re.search(rf"{name}_?{part}\"?\s*[=:]\s*[\[{{](.*?)(?:;|[\]}}]\s*[,;}}])", text, re.I | re.S)
            parts.append([] if found is None else numbers_in(found[1]))
        if [len(part) for part in parts] != [9, 3, 3]:
            continue
        S = _TO_SI[name] * np.array(parts[0]).reshape(3, 3) * np.array(parts[1])
        sensors[name] = S, -S @ np.array(parts[2])
    return given("xio", sensors) if "accelerometer" in sensors else None


FORMATS = (Format("xio", to_xio, from_xio),)
