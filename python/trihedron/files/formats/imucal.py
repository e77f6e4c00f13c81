"""imucal's Ferraris calibration: ``a = (K_a R_a)⁻¹ (raw - b_a)``, ``ω = (K_g R_g)⁻¹ (raw - b_g - K_ga a)``.

Units are stated in the file; corrected values are in m/s² and usually deg/s.
"""

import json
import math

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, given, heading
from trihedron.files.formats.kalibr import g_sensitivity
from trihedron.files.formats.parsing import array_of, json_of
from trihedron.records import Calibration
from trihedron.sensor_model import other_form
from trihedron.units import degrees_from_radians

_TO_SI = {"m/s^2": 1.0, "g": 9.80665, "deg/s": math.pi / 180.0, "dps": math.pi / 180.0, "rad/s": 1.0}
_WORDS = {"dps": "deg/s", "a.u.": "counts", "": "counts"}


def to_imucal(calibration: Calibration, _options: ExportOptions) -> str:
    """JSON of ``FerrarisCalibrationInfo``: K is the length of the rows of ``S⁻¹``, R their directions."""
    out: dict[str, object] = {"cal_type": "Ferraris"}
    said = (("a", "acc", "m/s^2"), ("g", "gyr", "deg/s"))
    for (name, sensor), (letter, word, unit) in zip(calibration.sensors, said, strict=False):
        forward, b = other_form(sensor.S, sensor.b)
        if name == "gyroscope":
            G = g_sensitivity(calibration)
            out["K_ga"] = (forward @ G).tolist()
            forward = forward / degrees_from_radians(1.0)
        length = np.linalg.norm(forward, axis=1)
        out |= {
            f"{word}_unit": unit,
            f"from_{word}_unit": sensor.raw_unit,
            f"K_{letter}": np.diag(length).tolist(),
            f"R_{letter}": (forward / length[:, None]).tolist(),
            f"b_{letter}": [float(v) for v in b],
        }
    equation = "acc = inv(K_a R_a) (raw - b_a); gyr = inv(K_g R_g) (raw - b_g - K_ga acc)."
    out["comment"] = " ".join(heading(calibration, equation, ("gyro-g-sensitivity",)))
    return json.dumps(out, indent=2) + "\n"


def from_imucal(text: str) -> Calibration | None:
    """A Ferraris or turntable calibration."""
    document = json_of(text) or {}
    if not {"K_a", "R_a", "b_a"} <= document.keys():
        return None
    eye, sensors, units, G = np.eye(3), {}, {}, None
    for name, letter, word in (("accelerometer", "a", "acc"), ("gyroscope", "g", "gyr")):
        if f"K_{letter}" not in document:
            continue
        forward = array_of(document[f"K_{letter}"], (3, 3), eye) @ array_of(document[f"R_{letter}"], (3, 3), eye)
        to_si = _TO_SI.get(str(document.get(f"{word}_unit")), 1.0)
        b = array_of(document[f"b_{letter}"], (3,), np.zeros(3))
        S, offset = other_form(forward / to_si, b)
        sensors[name] = S, offset
        stated = str(document.get(f"from_{word}_unit") or "")
        units[name] = _WORDS.get(stated, stated)
        if name == "gyroscope":
            G = S @ array_of(document.get("K_ga"), (3, 3), np.zeros((3, 3)))
    return given("imucal", sensors, units=units, g_sensitivity=G)


FORMATS = (Format("imucal", to_imucal, from_imucal),)
