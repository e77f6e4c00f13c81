"""RealSense: ``corrected = Mᵀ raw - bias`` per sensor, M the nine elements of ``scale_and_alignment`` row by row.

The manufacturer's script (tools/rs-imu-calibration of librealsense) solves ``raw · X - bias`` and writes X row by row;
the camera stores its transpose.
"""

import json

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, given, heading, of_si_readings
from trihedron.files.formats.parsing import array_of, json_of
from trihedron.records import Calibration


def to_realsense(calibration: Calibration, options: ExportOptions) -> str:
    """The script's ``calibration.json``."""
    known = of_si_readings(calibration, "RealSense", options)
    imu = {
        name: {
            "scale_and_alignment": [float(v) for v in sensor.S.T.ravel()],
            "bias": [float(v) + 0.0 for v in -sensor.b],
        }
        for name, sensor in known.sensors
    }
    said = heading(known, "corrected = transpose(M) raw - bias, M = scale_and_alignment row by row, SI.")
    return json.dumps({"imus": [imu], "written_by_trihedron": said}, indent=2) + "\n"


def from_realsense(text: str) -> Calibration | None:
    """``calibration.json`` of the manufacturer's script."""
    imus = (json_of(text) or {}).get("imus")
    if not isinstance(imus, list) or not imus or not isinstance(imus[0], dict):
        return None
    sensors = {}
    for name in ("accelerometer", "gyroscope"):
        one = imus[0].get(name)
        if isinstance(one, dict) and "scale_and_alignment" in one:
            M = array_of(one["scale_and_alignment"], (3, 3), np.eye(3))
            sensors[name] = M.T, -array_of(one.get("bias"), (3,), np.zeros(3))
    return given("realsense", sensors) if "accelerometer" in sensors else None


FORMATS = (Format("realsense", to_realsense, from_realsense, in_si=True),)
