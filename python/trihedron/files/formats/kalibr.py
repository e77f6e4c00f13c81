"""Kalibr's ``imu.yaml``: ``a_m = M a + b``, ``w_m = M C_gyro_i w + A C_gyro_i a + b``, true → measured.

M is lower triangular, C a rotation. Kalibr's results have the same keys under ``imu0``; it stores no biases.
"""

from typing import Any

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.files.formats.contract import ExportOptions, Format, effect_parameters, given, heading, of_si_readings
from trihedron.files.formats.from_templates import filled
from trihedron.files.formats.noise_keys import required
from trihedron.files.formats.parsing import array_of, without_readings, yaml_of
from trihedron.records import Calibration
from trihedron.sensor_model import in_frame, other_form

REQUIRED = {"accelerometer_noise_density", "gyroscope_noise_density"}
"""Keys by which a file of Kalibr is recognised."""


def to_kalibr(calibration: Calibration, options: ExportOptions) -> str:
    """``imu.yaml`` with the six keys that its reader requires, and intrinsics named as in Kalibr's results.

    Raises ``InputError`` when noise or rate, which the reader requires, are not given.
    """
    lower, M_a, b_a = in_lower(calibration, "Kalibr", options)
    figures = required(lower, options, "Kalibr")
    equation = "a_m = M a + b;  w_m = M C_gyro_i w + A C_gyro_i a + b: true to measured."
    said = heading(lower, equation, ("gyro-g-sensitivity",))
    names: dict[str, Any] = {"said": said, "topic": options.topic, "M_a": M_a, "b_a": b_a, "M": None}
    if lower.gyroscope is not None:
        inverse, names["b"] = other_form(lower.gyroscope.S, lower.gyroscope.b)
        M, C = lower_orthogonal(inverse)
        names |= {"M": np.tril(M), "A": inverse @ g_sensitivity(lower) @ C.T, "C": C}
    return filled("kalibr", figures, **names)


def from_kalibr(text: str) -> Calibration | None:
    """Intrinsics of an ``imu.yaml`` or of the results of ``kalibr_calibrate_imu_camera`` (``*-imu.yaml``).

    Raises ``InputError`` when it is the camera chain written beside those results, which contains only the pose of
    the IMU.
    """
    document = yaml_of(text)
    if document is None or text.lstrip().startswith("%YAML:1.0"):
        return None
    camera = document.get("cam0")
    if isinstance(camera, dict) and "T_cam_imu" in camera and "imu0" not in document:
        raise without_readings("Kalibr's camchain-imucam.yaml")
    document = document.get("imu0", document)
    if not isinstance(document, dict) or not document.keys() >= REQUIRED:
        return None
    accel, gyro = document.get("accelerometers") or {}, document.get("gyroscopes") or {}
    M_a = array_of(accel.get("M"), (3, 3), np.eye(3))
    M, C = array_of(gyro.get("M"), (3, 3), np.eye(3)), array_of(gyro.get("C_gyro_i"), (3, 3), np.eye(3))
    S = np.linalg.inv(M @ C)
    sensors = {
        "accelerometer": other_form(M_a, array_of(accel.get("b"), (3,), np.zeros(3))),
        "gyroscope": other_form(M @ C, array_of(gyro.get("b"), (3,), np.zeros(3))),
    }
    without = [name for name, one in (("accelerometer", accel), ("gyroscope", gyro)) if "b" not in one]
    G = S @ array_of(gyro.get("A"), (3, 3), np.zeros((3, 3))) @ C
    return given("kalibr", sensors, without_bias=without, g_sensitivity=G)


def g_sensitivity(calibration: Calibration) -> FloatArray:
    """(3, 3) gyro g-sensitivity [(rad/s)/(m/s²)] in the body frame; 0 where the calibration lacks it."""
    values = effect_parameters(calibration, "gyro-g-sensitivity")
    return np.array([[values.get(f"G_{i}{j}", 0.0) for j in AXES] for i in AXES])


def in_lower(
    calibration: Calibration, target: str, options: ExportOptions
) -> tuple[Calibration, FloatArray, FloatArray]:
    """The calibration of SI readings in the lower-triangular frame, and M, b of ``reading = M force + b``."""
    lower = in_frame(calibration, "lower") if calibration.frame != "lower" else calibration
    lower = of_si_readings(lower, target, options)
    M, b = other_form(lower.accelerometer.S, lower.accelerometer.b)
    return lower, np.tril(M), b


def lower_orthogonal(A: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``A = L Q`` with L lower triangular and Q a proper rotation, det Q = +1.

    The diagonal of L is positive where det A > 0. For a mirrored triad one diagonal element of L is negative, in the
    axis whose diagonal element of Q is smallest, so that Q contains no reflection.
    """
    q, r = np.linalg.qr(A.T)
    signs = np.where(np.diag(r) < 0.0, -1.0, 1.0)
    L, Q = (r * signs[:, None]).T, (q * signs).T
    if np.linalg.det(Q) < 0.0:
        flip = np.ones(3)
        flip[int(np.argmin(np.diag(Q)))] = -1.0
        L, Q = L * flip, flip[:, None] * Q
    return L, Q


FORMATS = (Format("kalibr", to_kalibr, from_kalibr, in_si=True),)
