"""imu_tk's ``.calib``, one file per sensor: ``x = T K (raw - B)``, T with unit diagonal, K diagonal.

imu_tk reads 3 x 3, 3 x 3 and 3 x 1 numbers from the first character on and ignores the rest, so comments are at the
end.
"""

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.files.formats.contract import ExportOptions, Format, given, heading, row
from trihedron.records import Calibration, SensorCalibration


def to_imu_tk(calibration: Calibration, _options: ExportOptions) -> dict[str, str]:
    """Both sensors, rotated to the frame in which T of the accelerometer is upper triangular."""
    rotation, turned = upper_frame(calibration)
    said = heading(calibration, "x = T K (raw - B): raw to true.")
    said += ["T of the accelerometer is upper triangular here, so both sensors are turned by this rotation:"]
    said += [row(r) for r in rotation]
    out: dict[str, str] = {}
    for (name, _), (_, S, b) in zip(calibration.sensors, turned, strict=True):
        scale = np.diag(S)
        bias = -np.linalg.solve(S, b)
        lines = [*(" ".join(map(repr, map(float, r))) for r in S / scale), ""]
        lines += [*(" ".join(map(repr, map(float, r))) for r in np.diag(scale)), ""]
        lines += [*(repr(float(v)) for v in bias), "", *(f"# {line}" for line in said), ""]
        out["_acc.calib" if name == "accelerometer" else "_gyro.calib"] = "\n".join(lines)
    return out


def from_imu_tk(text: str) -> Calibration | None:
    """The accelerometer's file, and the gyro's if it is in the same folder."""
    sensors = {}
    for name, part in zip(("accelerometer", "gyroscope"), text.split("\f"), strict=False):
        try:
            values = np.array([float(word) for word in part.partition("#")[0].split()])
        except ValueError:
            return None
        if len(values) != 21:
            return None
        T, K, B = values[:9].reshape(3, 3), values[9:18].reshape(3, 3), values[18:]
        if np.any(np.diag(T) != 1.0) or np.any(K - np.diag(np.diag(K))):
            return None
        sensors[name] = T @ K, -T @ K @ B
    return given("imu_tk", sensors) if sensors else None


def upper_frame(calibration: Calibration) -> tuple[FloatArray, list[tuple[SensorCalibration, FloatArray, FloatArray]]]:
    """Both sensors rotated by R so that the accelerometer's S is upper triangular: R and (sensor, R S, R b)."""
    q, r = np.linalg.qr(calibration.accelerometer.S)
    # The diagonal keeps its signs: a left-handed triad is not corrected by a reflection of the body frame.
    rotation = (q * (np.sign(np.diag(r)) * np.sign(np.diag(calibration.accelerometer.S)))).T
    turned = [(sensor, rotation @ sensor.S, rotation @ sensor.b) for _, sensor in calibration.sensors]
    # Rounding errors below the diagonal are set to 0, as the target expects.
    turned[0] = (turned[0][0], np.triu(turned[0][1]), turned[0][2])
    return rotation, turned


FORMATS = (Format("imu_tk", to_imu_tk, from_imu_tk, pair=("acc", "gyro")),)
