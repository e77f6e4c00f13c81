"""A calibration in the conventions of other programs, each with its own equation stated in it.

The direction of the matrices is the field's biggest trap: some tools store raw → true, some true → raw, some subtract
the zero before the matrix and some after it. Every writer here states the target's equation and is tested by
evaluating it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from trihedron.records import Calibration, SensorCalibration
from trihedron.sensor_model import in_frame, other_form

FloatArray = npt.NDArray[np.float64]

_NO_GYRO = "no gyroscope in this calibration"


def export_calibration(calibration: Calibration, target: str) -> str:
    """A calibration as text for ``target``, one of :data:`TARGETS`.

    Raises
    ------
    ValueError
        When there is no such target, or the calibration cannot be expressed in its convention.
    """
    if target not in TARGETS:
        raise ValueError(f"there is no export to {target!r}; there are {', '.join(TARGETS)}.")
    return TARGETS[target](calibration)


def lower_orthogonal(A: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``A = L Q`` with L lower triangular and Q a rotation; the signs of A's diagonal stay with L."""
    q, r = np.linalg.qr(A.T)
    signs = np.sign(np.diag(r)) * np.sign(np.diag(A))
    return (r * signs[:, None]).T, (q * signs).T


def upper_frame(calibration: Calibration) -> tuple[FloatArray, list[tuple[SensorCalibration, FloatArray, FloatArray]]]:
    """Both sensors turned by R so that the accelerometer's S is upper triangular: R and (sensor, R S, R b)."""
    q, r = np.linalg.qr(calibration.accelerometer.S)
    # The signs of the diagonal stay with S: a left-handed triad is not mended by a reflection of Mz.
    rotation = (q * (np.sign(np.diag(r)) * np.sign(np.diag(calibration.accelerometer.S)))).T
    turned = [(sensor, rotation @ sensor.S, rotation @ sensor.b) for sensor in _sensors(calibration)]
    # Rounding below the diagonal is removed: the target does not expect it.
    turned[0] = (turned[0][0], np.triu(turned[0][1]), turned[0][2])
    return rotation, turned


def _sensors(calibration: Calibration) -> list[SensorCalibration]:
    return [s for s in (calibration.accelerometer, calibration.gyroscope) if s is not None]


def _heading(calibration: Calibration, comment: str, equation: str) -> list[str]:
    rows = [
        f"Calibration of {calibration.recording_source or 'an unnamed recording'}, written by trihedron.",
        equation,
        f"Raw units: {', '.join(sensor.raw_unit for sensor in _sensors(calibration))}. "
        f"Corrected units: {', '.join(sensor.si_unit for sensor in _sensors(calibration))}.",
    ]
    if not calibration.is_trustworthy:
        rows.append("NOT TO BE TRUSTED: see the findings of the calibration.")
    return [f"{comment} {row}".replace("\n", " ") for row in rows]


def _row(values: npt.NDArray[np.floating]) -> str:
    return ", ".join(repr(float(v)) for v in values)


def _to_c(calibration: Calibration) -> str:
    lines = _heading(calibration, "//", "true = S * raw + b, raw to true, row by row.")
    lines += ["", "typedef struct { double S[3][3]; double b[3]; } trihedron_sensor;", ""]
    for name, sensor in zip(("accelerometer", "gyroscope"), _sensors(calibration), strict=False):
        rows = ",\n     ".join(f"{{{_row(row)}}}" for row in sensor.S)
        lines += [
            f"// {name}: {sensor.raw_unit} to {sensor.si_unit}",
            f"static const trihedron_sensor trihedron_{name} = {{",
            f"    {{{rows}}},",
            f"    {{{_row(sensor.b)}}}}};",
            "",
        ]
    lines += [
        "static void trihedron_correct(const trihedron_sensor *sensor, const double raw[3], double corrected[3])",
        "{",
        "    for (int i = 0; i < 3; ++i) {",
        "        corrected[i] = sensor->b[i];",
        "        for (int j = 0; j < 3; ++j) corrected[i] += sensor->S[i][j] * raw[j];",
        "    }",
        "}",
        "",
    ]
    return "\n".join(lines)


def _to_python(calibration: Calibration) -> str:
    lines = _heading(calibration, "#", "true = S @ raw + b, raw to true.")
    lines += ["", "import numpy as np", ""]
    for name, sensor in zip(("accelerometer", "gyroscope"), _sensors(calibration), strict=False):
        rows = ",\n    ".join(f"[{_row(row)}]" for row in sensor.S)
        upper = name.upper()
        lines += [
            f"# {name}: {sensor.raw_unit} to {sensor.si_unit}",
            f"S_{upper} = np.array([\n    {rows}])",
            f"B_{upper} = np.array([{_row(sensor.b)}])",
            "",
        ]
    lines += ["", "def correct(raw, S, b):", '    """Readings (n, 3) in raw units to true values (n, 3)."""']
    lines += ["    return np.asarray(raw) @ S.T + b", ""]
    return "\n".join(lines)


def _to_kalibr(calibration: Calibration) -> str:
    """``a_m = M a + b``, ``w_m = M C_gyro_i w + A a + b``: true → measured, M lower triangular."""
    lower = in_frame(calibration, "lower") if calibration.frame != "lower" else calibration
    equation = "a_m = M a + b;  w_m = M C_gyro_i w + A a + b: true to measured, the inverse of the direct form."
    lines = _heading(lower, "#", equation)
    lines += ["imu0:", "  model: scale-misalignment", "  accelerometers:", "    M:"]
    M, b = other_form(lower.accelerometer.S, lower.accelerometer.b)
    lines += [f"    - [{_row(row)}]" for row in np.tril(M)]
    lines += [f"    b: [{_row(b)}]  # not a key of Kalibr, which does not store biases"]
    if lower.gyroscope is None:
        return "\n".join([*lines, f"  # {_NO_GYRO}", ""])
    inverse, b = other_form(lower.gyroscope.S, lower.gyroscope.b)
    M, C = lower_orthogonal(inverse)
    lines += ["  gyroscopes:", "    M:", *(f"    - [{_row(row)}]" for row in np.tril(M))]
    lines += ["    A:", *(["    - [0.0, 0.0, 0.0]"] * 3)]
    lines += ["    C_gyro_i:", *(f"    - [{_row(row)}]" for row in C)]
    lines += [f"    b: [{_row(b)}]  # not a key of Kalibr, which does not store biases", ""]
    return "\n".join(lines)


def _to_imu_tk(calibration: Calibration) -> str:
    """``x = T K (raw - B)``: T with unit diagonal (upper triangular for the accelerometer), a blank line, K, B."""
    rotation, turned = upper_frame(calibration)
    equation = (
        "x = T K (raw - B): raw to true; each sensor is T (3x3), K (3x3 diagonal), B (3x1) with blank lines between."
    )
    lines = _heading(calibration, "#", equation)
    lines.append(
        "# T of the accelerometer is upper triangular here, so both results are turned by this rotation of Mz:"
    )
    lines += [f"# {_row(row)}" for row in rotation]
    for sensor, S, b in turned:
        scale = np.diag(S)
        zero = -np.linalg.solve(S, b)
        name = "accelerometer" if sensor is calibration.accelerometer else "gyroscope"
        lines += [f"# {name}"]
        lines += [*(" ".join(map(repr, map(float, row))) for row in S / scale), ""]
        lines += [*(" ".join(map(repr, map(float, row))) for row in np.diag(scale)), ""]
        lines += [*(repr(float(v)) for v in zero), ""]
    return "\n".join(lines)


def _to_basalt(calibration: Calibration) -> str:
    """``(I + M) raw - b``: the zero is subtracted after the matrix; b, then M by columns, its lower triangle
    (accel)."""
    lower = in_frame(calibration, "lower") if calibration.frame != "lower" else calibration
    _require_si(lower, "Basalt")
    M = lower.accelerometer.S - np.eye(3)
    columns = [*(-lower.accelerometer.b), *M[:, 0], *M[1:, 1], M[2, 2]]
    out = ["{", f'  "calib_accel_bias": [{_row(np.array(columns))}]']
    if lower.gyroscope is not None:
        M = lower.gyroscope.S - np.eye(3)
        out[-1] += ","
        out.append(f'  "calib_gyro_bias": [{_row(np.concatenate([-lower.gyroscope.b, M.T.ravel()]))}]')
    return "\n".join([*out, "}", ""])


def _to_xio(calibration: Calibration) -> str:
    """``M (s ∘ (raw - b))``: misalignment with unit diagonal, sensitivity, offset in raw units."""
    lines = _heading(calibration, "//", "corrected = misalignment * (sensitivity o (raw - offset)): raw to true.")
    for name, sensor in zip(("accelerometer", "gyroscope"), _sensors(calibration), strict=False):
        scale = np.diag(sensor.S)
        rows = ", ".join(_row(row) for row in sensor.S / scale)
        zero = -np.linalg.solve(sensor.S, sensor.b)
        lines += [
            f"const FusionMatrix {name}Misalignment = {{{rows}}};",
            f"const FusionVector {name}Sensitivity = {{{_row(scale)}}};",
            f"const FusionVector {name}Offset = {{{_row(zero)}}};",
        ]
    return "\n".join([*lines, ""])


def _to_pyins(calibration: Calibration) -> str:
    """``x_out = T x + b``: true → measured, T full."""
    lines = _heading(calibration, "#", "x_out = T x + b: true to measured, the inverse of the direct form.")
    lines += ["import numpy as np"]
    for name, sensor in zip(("accel", "gyro"), _sensors(calibration), strict=False):
        T, b = other_form(sensor.S, sensor.b)
        lines += [
            f"{name}_transform = np.array([{', '.join(f'[{_row(row)}]' for row in T)}])",
            f"{name}_bias = np.array([{_row(b)}])",
        ]
    return "\n".join([*lines, ""])


def _require_si(calibration: Calibration, target: str) -> None:
    for sensor in _sensors(calibration):
        if sensor.raw_unit != sensor.si_unit:
            raise ValueError(
                f"{target} expects raw readings in {sensor.si_unit} and this calibration maps {sensor.raw_unit}: "
                "log in SI, or export to C or Python."
            )


TARGETS: dict[str, Callable[[Calibration], str]] = {
    "c": _to_c,
    "python": _to_python,
    "kalibr": _to_kalibr,
    "imu_tk": _to_imu_tk,
    "basalt": _to_basalt,
    "xio": _to_xio,
    "pyins": _to_pyins,
}
"""What a calibration can be written for."""
