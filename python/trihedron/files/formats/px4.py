"""Parameters of PX4: ``R ((reading - thermal(T) - OFF) o SCALE)`` per sensor, gyros without a scale.

``thermal`` is ``X0 + X1 t + X2 t² + X3 t³`` of ``t = T - TREF``, T clamped to TMIN..TMAX. By sensor_calibration
and temperature_compensation of PX4-Autopilot, https://github.com/PX4/PX4-Autopilot.
"""

import numpy as np

from trihedron.arrays import XYZ
from trihedron.files.formats.autopilot import (
    AxisCorrection,
    Composed,
    about,
    board_of,
    composed,
    euler,
    held_by,
    moved_to,
    orientation,
    range_lines,
    said_of_misfit,
    triple,
)
from trihedron.files.formats.contract import ExportOptions, Format, Thermal, number
from trihedron.files.formats.losses import lost_gyro_scale
from trihedron.records import Calibration, Onboard

_REAL, _INTEGER = 9, 6
"""MAVLink's type numbers of a float and of a 32-bit integer in a parameter file."""


def to_px4(calibration: Calibration, options: ExportOptions) -> str:
    """Parameters for the board as a QGroundControl file, composed with the corrections of the log's readings."""
    board = board_of(calibration, options, "px4", "CAL_")
    own, sensors = composed(calibration, options, "PX4", lambda name: correction_of(board, name))
    has_scale = any(name.startswith("CAL_GYRO") and "SCALE" in name for name in board.parameters)
    equation = "corrected = (reading - thermal(T) - OFF) * SCALE per axis, SI" + (
        "." if has_scale else "; a gyro has OFF only."
    )
    names = ("SENS_BOARD_ROT", *(f"SENS_BOARD_{axis}_OFF" for axis in XYZ))
    turns = ", ".join(f"{name} {board.parameters.get(name, 0.0):g}" for name in names)
    lines = [*about(own, board, equation, turns), "#", "# Vehicle-Id Component-Id Name Value Type"]
    for name, one in sensors.items():
        root, _ = _names(board, name)
        device = board.parameters.get(f"{root}_ID")
        if device is None:
            lines.append(
                f"# {root}_ID must be that of the board (param show {root}_ID): without it PX4 ignores these lines."
            )
        else:
            lines.append(_line(f"{root}_ID", device, _INTEGER))
        for k, axis in enumerate(XYZ):
            lines.append(_line(f"{root}_{axis}OFF", one.offset[k]))
            if name == "accelerometer" or has_scale:
                lines.append(_line(f"{root}_{axis}SCALE", one.scale[k]))
        if own.gyroscope is not None and name == "gyroscope" and not has_scale:
            lines += [f"# {line}" for line in lost_gyro_scale(own.gyroscope, "PX4")]
        lines += _thermal_lines(board, name, one)
    return "\n".join([*lines, ""])


def from_px4(text: str) -> Calibration | None:
    """The first IMU's parameters as a calibration of readings in the sensor's axes."""
    return held_by(text, {"CAL_ACC0_XOFF", "CAL_ACC0_XSCALE"}, "px4", correction_of)


def correction_of(board: Onboard, name: str) -> AxisCorrection:
    """The board's correction of one sensor; none where its readings were logged raw."""
    if board.stage == "raw":
        return AxisCorrection(np.zeros(3), np.ones(3), np.eye(3))
    root, _ = _names(board, name)
    p = board.parameters
    turn = np.eye(3)
    if board.stage == "body":
        own = p.get(f"{root}_ROT", -1.0)
        offsets = [p.get(f"SENS_BOARD_{axis}_OFF", 0.0) for axis in XYZ]
        inside = euler(*offsets) @ orientation(p.get("SENS_BOARD_ROT", 0.0))
        turn = inside if own < 0.0 else orientation(own)
    scale = triple(p, f"{root}_{{}}SCALE", 1.0)
    return AxisCorrection(triple(p, f"{root}_{{}}OFF"), scale, turn, _held_thermal(board, name))


def _names(board: Onboard, name: str) -> tuple[str, str]:
    """Prefixes of one sensor's parameter names: of its calibration and of its temperature compensation."""
    if name == "accelerometer":
        return f"CAL_ACC{board.accel}", "TC_A"
    return f"CAL_GYRO{board.gyro}", "TC_G"


def _group(board: Onboard, name: str) -> str:
    """The sensor's group of temperature parameters, by device id; the one of the same number where no id matches."""
    root, letters = _names(board, name)
    device = board.parameters.get(f"{root}_ID", 0.0)
    own = next((i for i in range(4) if device and board.parameters.get(f"{letters}{i}_ID") == device), int(root[-1]))
    return f"{letters}{own}"


def _held_thermal(board: Onboard, name: str) -> Thermal | None:
    _, letters = _names(board, name)
    group, p = _group(board, name), board.parameters
    if p.get(f"{letters}_ENABLE", 0.0) != 1.0 or f"{group}_TREF" not in p:
        return None
    coefficients = np.array([[p.get(f"{group}_X{order}_{k}", 0.0) for k in range(3)] for order in (1, 2, 3)])
    return Thermal(p[f"{group}_TREF"], coefficients, (p.get(f"{group}_TMIN", 0.0), p.get(f"{group}_TMAX", 100.0)))


def _thermal_lines(board: Onboard, name: str, one: Composed) -> list[str]:
    held, new = _held_thermal(board, name), one.thermal
    if new is None:
        return []
    root, letters = _names(board, name)
    group = _group(board, name)
    total, constant = new.coefficients, np.zeros(3)
    if held is not None:
        moved, at_reference = moved_to(held, new.reference_degc)
        already = np.array([board.parameters.get(f"{group}_X0_{k}", 0.0) for k in range(3)])
        total, constant = total + moved, already + at_reference
    lines = [_line(f"{letters}_ENABLE", 1, _INTEGER)]
    device = board.parameters.get(f"{root}_ID")
    if device is None:
        lines.append(f"# {group}_ID must be that of the board.")
    else:
        lines.append(_line(f"{group}_ID", device, _INTEGER))
    lines += range_lines(new, held, f"{group}_", _line)
    lines.append(_line(f"{group}_TREF", new.reference_degc))
    lines += [_line(f"{group}_X0_{k}", v) for k, v in enumerate(constant)]
    for order in range(3):
        lines += [_line(f"{group}_X{order + 1}_{k}", v) for k, v in enumerate(total[order])]
    return [*lines, *(f"# {line}" for line in said_of_misfit(new, name))]


def _line(name: str, value: float, kind: int = _REAL) -> str:
    return f"1\t1\t{name}\t{number(float(value)) if kind == _REAL else f'{value:.0f}'}\t{kind}"


FORMATS = (Format("px4", to_px4, from_px4, in_si=True),)
