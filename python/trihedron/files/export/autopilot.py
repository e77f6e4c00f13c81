"""Parameters of autopilots: PX4 and ArduPilot. Both hold scales and zeros only; what that loses stands in the file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from trihedron.files.export.contract import (
    ExportOptions,
    effect_parameters,
    heading,
    lost_to_a_diagonal,
    of_si_readings,
)
from trihedron.records import Calibration, SensorCalibration

_AXES = ("x", "y", "z")
ARDUPILOT_REFERENCE_DEGC = 35.0
"""Temperature that ArduPilot's polynomials are counted from."""
_REAL, _INTEGER = 9, 6
"""MAVLink's numbers of a float and a 32-bit integer in a file of parameters."""


def to_px4(calibration: Calibration, options: ExportOptions) -> str:
    """``corrected = (reading - offset(T) - offset) * scale`` per axis; gyros have offsets only."""
    known = of_si_readings(calibration, "PX4", options)
    equation = "corrected = (reading - OFF) * SCALE per axis, SI; a gyro has OFF only."
    lines = [f"# {line}" for line in (*heading(known, equation), *lost_to_a_diagonal(known))]
    lines += [
        "# CAL_ACC0_ID and CAL_GYRO0_ID must be those of the board (param show CAL_*_ID): without them PX4",
        "# ignores the lines below. Axes are those of the sensor as it was logged.",
        "#",
        "# Vehicle-Id Component-Id Name Value Type",
    ]
    offset, scale = _diagonal(known.accelerometer)
    for k, axis in enumerate(_AXES):
        lines += [_px4(f"CAL_ACC0_{axis.upper()}OFF", offset[k]), _px4(f"CAL_ACC0_{axis.upper()}SCALE", scale[k])]
    if known.gyroscope is not None:
        offset, scale = _diagonal(known.gyroscope)
        lines += [_px4(f"CAL_GYRO0_{axis.upper()}OFF", offset[k]) for k, axis in enumerate(_AXES)]
        worst = 100.0 * float(np.abs(scale - 1.0).max())
        lines.append(f"# PX4 has no gyro scale: up to {worst:.2g} % of scale is lost.")
    for letter, sensor in (("A", "accel"), ("G", "gyro")):
        values = effect_parameters(known, f"{sensor}-thermal-bias")
        if values:
            lines += _px4_thermal(letter, values, _reference(known))
    return "\n".join([*lines, ""])


def to_ardupilot(calibration: Calibration, options: ExportOptions) -> str:
    """``corrected = (reading - OFFS) * SCAL`` per axis; gyros have offsets only; TCAL polynomials from 35 °C, × 1e6."""
    known = of_si_readings(calibration, "ArduPilot", options)
    equation = "corrected = (reading - OFFS) * SCAL per axis, SI; a gyro has OFFS only."
    lines = [f"# {line}" for line in (*heading(known, equation), *lost_to_a_diagonal(known))]
    lines.append("# Axes are those of the sensor as it was logged; the board's are x forward, z down.")
    offset, scale = _diagonal(known.accelerometer)
    for k, axis in enumerate(_AXES):
        lines += [f"INS_ACCOFFS_{axis.upper()},{offset[k]:.9g}", f"INS_ACCSCAL_{axis.upper()},{scale[k]:.9g}"]
    if known.gyroscope is not None:
        offset, scale = _diagonal(known.gyroscope)
        lines += [f"INS_GYROFFS_{axis.upper()},{offset[k]:.9g}" for k, axis in enumerate(_AXES)]
        worst = 100.0 * float(np.abs(scale - 1.0).max())
        lines.append(f"# ArduPilot has no gyro scale: up to {worst:.2g} % of scale is lost.")
    thermal = {s: effect_parameters(known, f"{s}-thermal-bias") for s in ("accel", "gyro")}
    if any(thermal.values()):
        lines += [
            "INS_TCAL1_ENABLE,1",
            "# Valid in the range of temperatures that was recorded: set TMIN and TMAX to it.",
        ]
        for sensor, name in (("accel", "ACC"), ("gyro", "GYR")):
            for order, values in _ardupilot_thermal(thermal[sensor], _reference(known)):
                lines += [
                    f"INS_TCAL1_{name}{order}_{a.upper()},{1e6 * v:.9g}" for a, v in zip(_AXES, values, strict=True)
                ]
    return "\n".join([*lines, ""])


def _diagonal(sensor: SensorCalibration) -> tuple[np.ndarray, np.ndarray]:
    """Offset in the readings and scale per axis: the zero is exact, the scale that of the axis itself."""
    return -np.linalg.solve(sensor.S, sensor.b), 1.0 / np.linalg.norm(np.linalg.inv(sensor.S), axis=1)


def _px4(name: str, value: float) -> str:
    return f"1\t1\t{name}\t{value:.9g}\t{_REAL}"


def _reference(calibration: Calibration) -> float:
    references = calibration.extensions.get("references", {})
    return float(references.get("temperature_degc", 25.0)) if isinstance(references, Mapping) else 25.0


def _orders(values: dict[str, float]) -> list[list[float]]:
    return [
        [values.get(f"{symbol}_{axis}", 0.0) for axis in _AXES] for symbol in ("bias_per_kelvin", "bias_per_kelvin2")
    ]


def _px4_thermal(letter: str, values: dict[str, float], reference: float) -> list[str]:
    lines = [f"1\t1\tTC_{letter}_ENABLE\t1\t{_INTEGER}", _px4(f"TC_{letter}0_TREF", reference)]
    lines.append(f"# TC_{letter}0_ID, TMIN and TMAX: of the board, and the range of temperatures that was recorded.")
    for order, row in enumerate(_orders(values), start=1):
        lines += [_px4(f"TC_{letter}0_X{order}_{k}", v) for k, v in enumerate(row)]
    return lines


def _ardupilot_thermal(values: dict[str, float], reference: float) -> list[tuple[int, list[float]]]:
    """c1 (T - r) + c2 (T - r)² counted from 35 °C instead of r; the constant goes, as the offsets hold it."""
    if not values:
        return []
    first, second = _orders(values)
    shift = ARDUPILOT_REFERENCE_DEGC - reference
    moved = [a + 2.0 * b * shift for a, b in zip(first, second, strict=True)]
    return [(1, moved), (2, second), (3, [0.0, 0.0, 0.0])]
