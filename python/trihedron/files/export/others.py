"""Calibrations for imu_tk, xio Fusion and pyins."""

from __future__ import annotations

import numpy as np

from trihedron.files.export.contract import ExportOptions, heading, row
from trihedron.files.export.matrices import upper_frame
from trihedron.files.plausible import named_sensors
from trihedron.records import Calibration
from trihedron.sensor_model import other_form
from trihedron.units import STANDARD_GRAVITY_M_S2, degrees_from_radians


def to_imu_tk(calibration: Calibration, _options: ExportOptions) -> dict[str, str]:
    """``x = T K (raw - B)``, one file a sensor: T with unit diagonal, K, B, numbers first.

    imu_tk reads 3 x 3, 3 x 3 and 3 x 1 numbers from the first character on and nothing behind them: what is to be said
    stands at the end.
    """
    rotation, turned = upper_frame(calibration)
    said = heading(calibration, "x = T K (raw - B): raw to true.")
    said += ["T of the accelerometer is upper triangular here, so both sensors are turned by this rotation of Mz:"]
    said += [row(r) for r in rotation]
    out: dict[str, str] = {}
    for (name, _), (_, S, b) in zip(named_sensors(calibration), turned, strict=True):
        scale = np.diag(S)
        zero = -np.linalg.solve(S, b)
        lines = [*(" ".join(map(repr, map(float, r))) for r in S / scale), ""]
        lines += [*(" ".join(map(repr, map(float, r))) for r in np.diag(scale)), ""]
        lines += [*(repr(float(v)) for v in zero), "", *(f"# {line}" for line in said), ""]
        out["_acc.calib" if name == "accelerometer" else "_gyro.calib"] = "\n".join(lines)
    return out


def to_xio(calibration: Calibration, _options: ExportOptions) -> str:
    """``M (s ∘ (raw - b))``: misalignment with unit diagonal, sensitivity to g and deg/s, offset in raw units.

    Fusion's filter takes g and degrees per second, whatever the readings are in.
    """
    equation = "corrected = misalignment * (sensitivity o (raw - offset)): raw to g and deg/s, as Fusion expects."
    lines = [f"// {line}" for line in heading(calibration, equation)]
    wanted = {"accelerometer": 1.0 / STANDARD_GRAVITY_M_S2, "gyroscope": degrees_from_radians(1.0)}
    for name, sensor in named_sensors(calibration):
        S = wanted[name] * sensor.S
        scale = np.diag(S)
        rows = ", ".join(row(r) for r in S / scale)
        zero = -np.linalg.solve(sensor.S, sensor.b)
        lines += [
            f"const FusionMatrix {name}Misalignment = {{{rows}}};",
            f"const FusionVector {name}Sensitivity = {{{row(scale)}}};",
            f"const FusionVector {name}Offset = {{{row(zero)}}};",
        ]
    return "\n".join([*lines, ""])


def to_pyins(calibration: Calibration, _options: ExportOptions) -> str:
    """``x_out = T x + b``: true → measured, T full."""
    lines = [
        f"# {line}"
        for line in heading(calibration, "x_out = T x + b: true to measured, the inverse of the direct form.")
    ]
    lines += ["import numpy as np"]
    for (_, sensor), name in zip(named_sensors(calibration), ("accel", "gyro"), strict=False):
        T, b = other_form(sensor.S, sensor.b)
        lines += [
            f"{name}_transform = np.array([{', '.join(f'[{row(r)}]' for r in T)}])",
            f"{name}_bias = np.array([{row(b)}])",
        ]
    return "\n".join([*lines, ""])
