"""Calibrations for visual-inertial programs: Kalibr, OpenVINS, VINS-Fusion, Basalt, and ROS messages."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.files.export.contract import (
    NO_GYRO,
    ExportOptions,
    NoiseFigure,
    SensorNoise,
    effect_parameters,
    heading,
    lost_to_a_diagonal,
    number,
    of_si_readings,
    row,
)
from trihedron.files.export.matrices import lower_orthogonal
from trihedron.records import Calibration
from trihedron.refused import RefusedError
from trihedron.sensor_model import in_frame, other_form

_AXES = ("x", "y", "z")


def to_kalibr(calibration: Calibration, options: ExportOptions) -> str:
    """``imu.yaml`` with the six keys that its reader requires, and intrinsics as its results name them.

    ``a_m = M a + b``, ``w_m = M C_gyro_i w + A C_gyro_i a + b``: true → measured, M lower triangular, C a rotation.
    """
    lower, M_a, b_a = _lower(calibration, "Kalibr", options)
    equation = "a_m = M a + b;  w_m = M C_gyro_i w + A C_gyro_i a + b: true to measured."
    lines = [f"# {line}" for line in heading(_without(lower, ("gyro-g-sensitivity",)), equation)]
    lines += ["# The six keys that the reader of an imu.yaml requires:"]
    lines += _noise_rows(options)
    lines += [f"rostopic: {options.topic}", _rate_row(options)]
    lines += ["# Intrinsics, named as in Kalibr's own results:", "model: scale-misalignment", "accelerometers:", "  M:"]
    lines += _matrix(M_a, 2)
    lines += ["  # not a key of Kalibr, which does not store biases:", f"  b: [{row(b_a)}]"]
    if lower.gyroscope is None:
        return "\n".join([*lines, f"# {NO_GYRO}", ""])
    inverse, b = other_form(lower.gyroscope.S, lower.gyroscope.b)
    M, C = lower_orthogonal(inverse)
    lines += ["gyroscopes:", "  M:", *_matrix(np.tril(M), 2)]
    lines += ["  A:", *_matrix(inverse @ _g_sensitivity(lower) @ C.T, 2)]
    lines += ["  C_gyro_i:", *_matrix(C, 2)]
    return "\n".join([*lines, "  # not a key of Kalibr, which does not store biases:", f"  b: [{row(b)}]", ""])


def to_openvins(calibration: Calibration, options: ExportOptions) -> str:
    """``kalibr_imu_chain.yaml`` for ``model: kalibr``: a = Ta⁻¹(a_m - b), ω = R_IMUtoGYROᵀ Tw⁻¹(w_m - b - Tg a).

    Comments stand on lines of their own: OpenCV's reader takes a value with a comment behind it for a sequence.
    """
    lower, M_a, b_a = _lower(calibration, "OpenVINS", options)
    equation = "a = inv(Ta) (a_m - b_a);  w = R_IMUtoGYRO^T inv(Tw) (w_m - b_w - Tg a)."
    lines = ["%YAML:1.0", *(f"# {line}" for line in heading(_without(lower, ("gyro-g-sensitivity",)), equation))]
    Tw, C, Tg, b_w = np.eye(3), np.eye(3), np.zeros((3, 3)), np.zeros(3)
    if lower.gyroscope is not None:
        inverse, b_w = other_form(lower.gyroscope.S, lower.gyroscope.b)
        M, C = lower_orthogonal(inverse)
        Tw, Tg = np.tril(M), inverse @ _g_sensitivity(lower)
    else:
        lines.append(f"# {NO_GYRO}: Tw and R_IMUtoGYRO are those of an ideal one.")
    lines += ["# Zeros are states of the filter, not keys of this file; here they were, in readings:"]
    lines += [f"#   accelerometer [{row(b_a)}]", f"#   gyroscope [{row(b_w)}]"]
    lines += ["imu0:", "  T_i_b:", *_matrix(np.eye(4), 4)]
    lines += [f"  {line}" for line in _noise_rows(options)]
    lines += [f"  rostopic: {options.topic}", "  time_offset: 0.0", f"  {_rate_row(options)}", '  model: "kalibr"']
    for key, value in (("Tw", Tw), ("R_IMUtoGYRO", C), ("Ta", M_a), ("R_IMUtoACC", np.eye(3)), ("Tg", Tg)):
        lines += [f"  {key}:", *_matrix(value, 4)]
    return "\n".join([*lines, ""])


def to_vins_fusion(calibration: Calibration, options: ExportOptions) -> str:
    """Noise, topic and gravity for its configuration, which has no place for S: what that loses is said in it."""
    known = of_si_readings(calibration, "VINS-Fusion", options)
    lines = ["%YAML:1.0", *(f"# {line}" for line in heading(known, "VINS-Fusion has no intrinsics of the IMU."))]
    lines += [f"# {line}" for line in _lost_without_intrinsics(known)]
    lines += ["imu: 1", f'imu_topic: "{options.topic}"']
    for key, noise, term in _four(options):
        lines += _noise_row({"accN": "acc_n", "accK": "acc_w", "gyrN": "gyr_n", "gyrK": "gyr_w"}[key], noise, term)
    return "\n".join([*lines, f"g_norm: {number(known.gravity_m_s2)}", ""])


def to_basalt(calibration: Calibration, options: ExportOptions) -> str:
    """``(I + M) raw - b``: b, then M by columns, its lower triangle (accelerometer); noise densities and rate."""
    known = in_frame(calibration, "lower") if calibration.frame != "lower" else calibration
    known = of_si_readings(known, "Basalt", options)
    M = known.accelerometer.S - np.eye(3)
    value: dict[str, object] = {
        "calib_accel_bias": [*(-known.accelerometer.b), *M[:, 0], *M[1:, 1], M[2, 2]],
    }
    if known.gyroscope is not None:
        M = known.gyroscope.S - np.eye(3)
        value["calib_gyro_bias"] = [*(-known.gyroscope.b), *M.T.ravel()]
    if options.rate_hz is not None:
        value["imu_update_rate"] = options.rate_hz
    names = {"accN": "accel_noise_std", "accK": "accel_bias_std", "gyrN": "gyro_noise_std", "gyrK": "gyro_bias_std"}
    for key, noise, term in _four(options):
        if noise is not None:
            value[names[key]] = [_figure(noise, term).value] * 3
    comment = heading(known, "corrected = (I + M) raw - b; noise in SI/sqrt(Hz) and SI/sqrt(s).")
    comment += _limits(options)
    plain = json.loads(json.dumps(value, default=float))
    return json.dumps({"value0": plain, "written_by_trihedron": comment}, indent=2) + "\n"


def to_ros(calibration: Calibration, options: ExportOptions) -> str:
    """Covariances of ``sensor_msgs/Imu``: N² times the rate, of one message, on the diagonal, row by row.

    Raises
    ------
    ValueError
        When noise or rate are missing: a covariance is made of both.
    """
    known = of_si_readings(calibration, "ROS", options)
    if options.rate_hz is None or options.accelerometer_noise is None:
        raise RefusedError(
            "the covariance of a message needs the noise and the rate: add --noise ALLAN.json --rate HZ."
        )
    equation = "sensor_msgs/Imu: variance of one message = N^2 * rate, in SI; apply S and b before publishing."
    lines = [f"# {line}" for line in (*heading(known, equation), *_lost_without_intrinsics(known))]
    pairs = (("linear_acceleration", options.accelerometer_noise), ("angular_velocity", options.gyroscope_noise))
    for name, noise in pairs:
        if noise is None:
            lines += [f"# {name}_covariance: not known"]
            continue
        variance = noise.N.value**2 * options.rate_hz
        lines += [f"{name}_covariance: [{row(variance * np.eye(3).ravel())}]"]
    unknown = np.zeros(9)
    unknown[0] = -1.0
    lines.append("# The first number is -1 by the message's definition where there is no orientation.")
    return "\n".join([*lines, f"orientation_covariance: [{row(unknown)}]", ""])


def _lower(calibration: Calibration, target: str, options: ExportOptions) -> tuple[Calibration, FloatArray, FloatArray]:
    lower = in_frame(calibration, "lower") if calibration.frame != "lower" else calibration
    lower = of_si_readings(lower, target, options)
    M, b = other_form(lower.accelerometer.S, lower.accelerometer.b)
    return lower, np.tril(M), b


def _g_sensitivity(calibration: Calibration) -> FloatArray:
    """(3, 3) rate read per specific force in the instrument frame; zero where the calibration does not have it."""
    values = effect_parameters(calibration, "gyro-g-sensitivity")
    return np.array([[values.get(f"G_{i}{j}", 0.0) for j in _AXES] for i in _AXES])


def _without(calibration: Calibration, ids: tuple[str, ...]) -> Calibration:
    """The calibration as its heading may describe it: effects that the target holds are not left out."""
    effects = calibration.extensions.get("effects")
    if not isinstance(effects, list | tuple):
        return calibration
    kept = [effect for effect in effects if effect["id"] not in ids]
    return replace(calibration, extensions=MappingProxyType({**calibration.extensions, "effects": kept}))


def _matrix(values: FloatArray, indent: int) -> list[str]:
    return [f"{' ' * indent}- [{row(r)}]" for r in values]


def _four(options: ExportOptions) -> list[tuple[str, SensorNoise | None, str]]:
    return [
        ("accN", options.accelerometer_noise, "N"),
        ("accK", options.accelerometer_noise, "K"),
        ("gyrN", options.gyroscope_noise, "N"),
        ("gyrK", options.gyroscope_noise, "K"),
    ]


def _figure(noise: SensorNoise, term: str) -> NoiseFigure:
    return noise.N if term == "N" else noise.K


def _noise_rows(options: ExportOptions) -> list[str]:
    names = {
        "accN": "accelerometer_noise_density",
        "accK": "accelerometer_random_walk",
        "gyrN": "gyroscope_noise_density",
        "gyrK": "gyroscope_random_walk",
    }
    return [line for key, noise, term in _four(options) for line in _noise_row(names[key], noise, term)]


def _noise_row(name: str, noise: SensorNoise | None, term: str) -> list[str]:
    if noise is None:
        return [f"# {name}: not known; record hours of rest, trihedron allan --json, then export with --noise"]
    figure = _figure(noise, term)
    unit = ("m/s^2" if name.startswith("acc") else "rad/s") + ("/sqrt(Hz)" if term == "N" else "/sqrt(s)")
    said = f"# {unit}" + (", an upper limit: this walk was not seen in the rest log" if figure.is_limit else "")
    return [said, f"{name}: {number(figure.value)}"]


def _limits(options: ExportOptions) -> list[str]:
    return [
        f"{name} {term} is an upper limit: it was not seen in the rest log."
        for name, noise in (("accelerometer", options.accelerometer_noise), ("gyroscope", options.gyroscope_noise))
        if noise is not None
        for term, figure in (("N", noise.N), ("K", noise.K))
        if figure.is_limit
    ]


def _rate_row(options: ExportOptions) -> str:
    return "# update_rate: not known; export with --rate HZ" if options.rate_hz is None else (
        f"update_rate: {number(options.rate_hz)}"
    )  # fmt: skip


def _lost_without_intrinsics(calibration: Calibration) -> list[str]:
    g = calibration.gravity_m_s2
    error = calibration.accelerometer.S - np.eye(3)
    worst = math.sqrt(float(np.linalg.eigvalsh(error.T @ error).max())) * g
    said = [
        f"Apply S and b to the readings before they are published. Left out they are worth up to {worst:.2g} m/s^2 of "
        f"scale and angle at 1 g and {np.linalg.norm(calibration.accelerometer.b):.2g} m/s^2 of zero."
    ]
    return said + (lost_to_a_diagonal(calibration) if np.any(error) else [])
