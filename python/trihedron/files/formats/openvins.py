"""OpenVINS: ``a = R_IMUtoACCᵀ Ta⁻¹ (a_m - b)``, ``ω = R_IMUtoGYROᵀ Tw⁻¹ (w_m - b - Tg a)``."""

import re

import numpy as np

from trihedron.files.formats.contract import (
    NO_GYRO,
    ExportOptions,
    Format,
    given,
    heading,
    matrix_rows,
    number,
    row,
)
from trihedron.files.formats.kalibr import g_sensitivity, in_lower, lower_orthogonal
from trihedron.files.formats.noise_keys import KALIBR, required, si_rows
from trihedron.files.formats.parsing import array_of, numbers_in, yaml_of
from trihedron.records import Calibration
from trihedron.sensor_model import other_form


def to_openvins(calibration: Calibration, options: ExportOptions) -> str:
    """The IMU chain file for ``model: kalibr``.

    Comments are on separate lines: OpenCV's reader takes a value followed by a comment for a sequence.

    Raises ``InputError`` when noise or rate, which the reader requires, are not given.
    """
    lower, M_a, b_a = in_lower(calibration, "OpenVINS", options)
    figures = required(lower, options, "OpenVINS")
    equation = "a = inv(Ta) (a_m - b_a);  w = R_IMUtoGYRO^T inv(Tw) (w_m - b_w - Tg a)."
    lines = ["%YAML:1.0", *(f"# {line}" for line in heading(lower, equation, ("gyro-g-sensitivity",)))]
    Tw, C, Tg, b_w = np.eye(3), np.eye(3), np.zeros((3, 3)), np.zeros(3)
    if lower.gyroscope is not None:
        inverse, b_w = other_form(lower.gyroscope.S, lower.gyroscope.b)
        M, C = lower_orthogonal(inverse)
        Tw, Tg = np.tril(M), inverse @ g_sensitivity(lower)
    else:
        lines.append(f"# {NO_GYRO}: Tw and R_IMUtoGYRO are those of an ideal one.")
    lines += ["# Biases are states of the filter, not keys of this file; here they were, in readings:"]
    lines += [f"#   accelerometer [{row(b_a)}]", f"#   gyroscope [{row(b_w)}]"]
    lines += ["imu0:", "  T_i_b:", *matrix_rows(np.eye(4), 4)]
    lines += [f"  {line}" for line in si_rows(figures, KALIBR)]
    lines += [f"  rostopic: {options.topic}", "  time_offset: 0.0", f"  update_rate: {number(figures.rate_hz)}"]
    lines += ['  model: "kalibr"']
    for key, value in (("Tw", Tw), ("R_IMUtoGYRO", C), ("Ta", M_a), ("R_IMUtoACC", np.eye(3)), ("Tg", Tg)):
        lines += [f"  {key}:", *matrix_rows(value, 4)]
    return "\n".join([*lines, ""])


def from_openvins(text: str) -> Calibration | None:
    """Intrinsics of the IMU chain file, for either model; biases from the comments that :func:`to_openvins` writes."""
    document = yaml_of(text)
    imu = None if document is None else document.get("imu0")
    if not isinstance(imu, dict) or not {"Ta", "Tw"} <= imu.keys():
        return None
    eye = np.eye(3)
    Ta, Tw, R_a, R_w = (array_of(imu.get(key), (3, 3), eye) for key in ("Ta", "Tw", "R_IMUtoACC", "R_IMUtoGYRO"))
    Tg = array_of(imu.get("Tg"), (3, 3), np.zeros((3, 3)))
    sensors, without = {}, []
    for name, forward in (("accelerometer", Ta @ R_a), ("gyroscope", Tw @ R_w)):
        stated = re.search(rf"^#   {name} \[(.*)\]", text, re.MULTILINE)
        if stated is None:
            without.append(name)
        S, b = other_form(forward, np.zeros(3) if stated is None else np.array(numbers_in(stated[1])))
        sensors[name] = S, b
    return given("openvins", sensors, without_bias=without, g_sensitivity=sensors["gyroscope"][0] @ Tg)


FORMATS = (Format("openvins", to_openvins, from_openvins, in_si=True),)
