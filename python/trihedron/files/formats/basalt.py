"""Basalt's calibration: ``(I + M) raw - b``; b, then M by columns, for the accelerometer only its lower triangle."""

import json

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, given, heading
from trihedron.files.formats.kalibr import in_lower
from trihedron.files.formats.noise_keys import limits
from trihedron.files.formats.parsing import array_of, json_of
from trihedron.records import Calibration


def to_basalt(calibration: Calibration, options: ExportOptions) -> str:
    """Intrinsics, and noise densities and rate where they are given."""
    known, _, _ = in_lower(calibration, "Basalt", options)
    M = known.accelerometer.S - np.eye(3)
    value: dict[str, object] = {"calib_accel_bias": [*(-known.accelerometer.b), *M[:, 0], *M[1:, 1], M[2, 2]]}
    if known.gyroscope is not None:
        M = known.gyroscope.S - np.eye(3)
        value["calib_gyro_bias"] = [*(-known.gyroscope.b), *M.T.ravel()]
    if options.rate_hz is not None:
        value["imu_update_rate"] = options.rate_hz
    for name, noise in (("accel", options.accelerometer_noise), ("gyro", options.gyroscope_noise)):
        if noise is not None:
            value[f"{name}_noise_std"], value[f"{name}_bias_std"] = [noise.N.value] * 3, [noise.K.value] * 3
    comment = heading(known, "corrected = (I + M) raw - b; noise in SI/sqrt(Hz) and SI/sqrt(s).")
    plain = json.loads(json.dumps(value, default=float))
    return json.dumps({"value0": plain, "written_by_trihedron": [*comment, *limits(options)]}, indent=2) + "\n"


def from_basalt(text: str) -> Calibration | None:
    """Intrinsics of the accelerometer (9 numbers) and the gyro (12)."""
    document = json_of(text) or {}
    value = document.get("value0")
    if not isinstance(value, dict) or "calib_accel_bias" not in value:
        return None
    a = array_of(value["calib_accel_bias"], (9,), np.zeros(9))
    M = np.array([[a[3], 0, 0], [a[4], a[6], 0], [a[5], a[7], a[8]]])
    sensors = {"accelerometer": (np.eye(3) + M, -a[:3])}
    if "calib_gyro_bias" in value:
        w = array_of(value["calib_gyro_bias"], (12,), np.zeros(12))
        sensors["gyroscope"] = np.eye(3) + w[3:].reshape(3, 3).T, -w[:3]
    return given("basalt", sensors)


FORMATS = (Format("basalt", to_basalt, from_basalt, in_si=True),)
