"""OpenVINS: ``a = R_IMUtoACCᵀ Ta⁻¹ (a_m - b)``, ``ω = R_IMUtoGYROᵀ Tw⁻¹ (w_m - b - Tg a)``."""

import re

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, given, heading
from trihedron.files.formats.from_templates import filled
from trihedron.files.formats.kalibr import g_sensitivity, in_lower, lower_orthogonal
from trihedron.files.formats.noise_keys import required
from trihedron.files.formats.parsing import array_of, numbers_in, yaml_of
from trihedron.records import Calibration
from trihedron.sensor_model import other_form


def to_openvins(calibration: Calibration, options: ExportOptions) -> str:
    """The IMU chain file for ``model: kalibr``.

    Raises ``InputError`` when noise or rate, which the reader requires, are not given.
    """
    lower, M_a, b_a = in_lower(calibration, "OpenVINS", options)
    figures = required(lower, options, "OpenVINS")
    equation = "a = inv(Ta) (a_m - b_a);  w = R_IMUtoGYRO^T inv(Tw) (w_m - b_w - Tg a)."
    Tw, C, Tg, b_w = np.eye(3), np.eye(3), np.zeros((3, 3)), np.zeros(3)
    if lower.gyroscope is not None:
        inverse, b_w = other_form(lower.gyroscope.S, lower.gyroscope.b)
        M, C = lower_orthogonal(inverse)
        Tw, Tg = np.tril(M), inverse @ g_sensitivity(lower)
    return filled(
        "openvins",
        figures,
        said=heading(lower, equation, ("gyro-g-sensitivity",)),
        has_gyro=lower.gyroscope is not None,
        topic=options.topic,
        identity4=np.eye(4),
        matrices=(("Tw", Tw), ("R_IMUtoGYRO", C), ("Ta", M_a), ("R_IMUtoACC", np.eye(3)), ("Tg", Tg)),
        b_a=b_a,
        b=b_w,
    )


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
