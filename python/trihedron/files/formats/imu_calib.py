"""The ROS package imu_calib: ``corrected = SM raw - bias``, accelerometer only, SM row by row."""

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, given, heading, of_si_readings, row
from trihedron.files.formats.losses import has_matrix
from trihedron.files.formats.parsing import array_of, yaml_of
from trihedron.records import Calibration


def to_imu_calib(calibration: Calibration, options: ExportOptions) -> str:
    """``imu_calib.yaml``; the package measures the gyro bias at start and has no gyro scale."""
    known = of_si_readings(calibration, "imu_calib", options)
    lines = [f"# {line}" for line in heading(known, "corrected = SM raw - bias, SI, accelerometer only.")]
    if known.gyroscope is not None and has_matrix(known.gyroscope):
        worst = 100.0 * float(np.linalg.norm(known.gyroscope.S - np.eye(3), 2))
        lines.append(f"# The gyro's scale and misalignment are lost, up to {worst:.2g} % of the rate.")
    lines += [f"SM: [{row(known.accelerometer.S.ravel())}]", f"bias: [{row(-known.accelerometer.b)}]", ""]
    return "\n".join(lines)


def from_imu_calib(text: str) -> Calibration | None:
    """Scale, misalignment and bias of the accelerometer."""
    document = yaml_of(text) or {}
    if not {"SM", "bias"} <= document.keys():
        return None
    SM, bias = array_of(document["SM"], (3, 3), np.eye(3)), array_of(document["bias"], (3,), np.zeros(3))
    return given("imu_calib", {"accelerometer": (SM, -bias)})


FORMATS = (Format("imu_calib", to_imu_calib, from_imu_calib, in_si=True),)
