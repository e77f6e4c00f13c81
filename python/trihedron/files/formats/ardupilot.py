"""Parameters of ArduPilot: ``R (SCAL o (reading - P(T) + P(CALTEMP) - OFFS))`` per sensor, gyros without a scale.

``P`` is a cubic of ``T - 35 degC`` with coefficients 1e-6 ``INS_TCALn_*``; T and CALTEMP are clamped to the range from
TMIN to TMAX. By AP_InertialSensor (Backend and tempcal) of ArduPilot, https://github.com/ArduPilot/ardupilot.
"""

import numpy as np

from trihedron.arrays import XYZ, FloatArray
from trihedron.files.formats.autopilot import (
    AxisCorrection,
    Composed,
    about,
    board_of,
    composed,
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

REFERENCE_DEGC = 35.0
"""Reference temperature of ArduPilot's polynomials."""
_SCALE = 1e-6


def to_ardupilot(calibration: Calibration, options: ExportOptions) -> str:
    """Parameters for the board as lines ``NAME,VALUE``, composed with the corrections of the log's readings."""
    board = board_of(calibration, options, "ardupilot", "INS_")
    own, sensors = composed(calibration, options, "ArduPilot", lambda name: correction_of(board, name))
    equation = "corrected = (reading - P(T) + P(CALTEMP) - OFFS) * SCAL per axis, SI; a gyro has no SCAL."
    lines = about(own, board, equation, f"AHRS_ORIENTATION {board.parameters.get('AHRS_ORIENTATION', 0.0):g}")
    for name, one in sensors.items():
        imu, letters = _names(board, name)
        suffix = _suffix(imu)
        known = board.parameters.get(f"INS_{letters}{suffix}_ID")
        if known is not None:
            lines.append(f"INS_{letters}{suffix}_ID,{known:.0f}")
        constant, thermal = _thermal_lines(board, name, one)
        for k, axis in enumerate(XYZ):
            lines.append(f"INS_{letters}{suffix}OFFS_{axis},{number(float(one.offset[k] + constant[k]))}")
            if name == "accelerometer":
                lines.append(f"INS_{letters}{suffix}SCAL_{axis},{number(float(one.scale[k]))}")
        lines += thermal
        if own.gyroscope is not None and name == "gyroscope":
            lines += [f"# {line}" for line in lost_gyro_scale(own.gyroscope, "ArduPilot")]
            lines.append(f"# INS_GYR_CAL other than 0 measures INS_GYR{suffix}OFFS anew at every start.")
    return "\n".join([*lines, ""])


def from_ardupilot(text: str) -> Calibration | None:
    """The first IMU's parameters as a calibration of readings in the sensor's axes."""
    return held_by(text, {"INS_ACCOFFS_X", "INS_ACCSCAL_X"}, "ardupilot", correction_of)


def correction_of(board: Onboard, name: str) -> AxisCorrection:
    """The board's correction of one sensor; none where its readings were logged raw."""
    if board.stage == "raw":
        return AxisCorrection(np.zeros(3), np.ones(3), np.eye(3))
    imu, letters = _names(board, name)
    root, suffix = f"INS_{letters}", _suffix(imu)
    # A gyro has no such parameters.
    scale = triple(board.parameters, f"{root}{suffix}SCAL_{{}}", 1.0)
    # A scale of 0 means that the sensor was never calibrated.
    scale = np.where(scale == 0.0, 1.0, scale)
    turn = np.eye(3) if board.stage == "corrected" else orientation(board.parameters.get("AHRS_ORIENTATION", 0.0))
    return AxisCorrection(triple(board.parameters, f"{root}{suffix}OFFS_{{}}"), scale, turn, _held_thermal(board, name))


def _names(board: Onboard, name: str) -> tuple[int, str]:
    """The sensor's number on the board (from 0), and the letters in the names of its parameters."""
    return (board.accel, "ACC") if name == "accelerometer" else (board.gyro, "GYR")


def _suffix(imu: int) -> str:
    return "" if imu == 0 else str(imu + 1)


def _held_thermal(board: Onboard, name: str) -> Thermal | None:
    imu, letters = _names(board, name)
    root, p = f"INS_TCAL{imu + 1}_", board.parameters
    if p.get(f"{root}ENABLE", 0.0) != 1.0:
        return None
    coefficients = np.array([_SCALE * triple(p, f"{root}{letters}{order}_{{}}") for order in (1, 2, 3)])
    return Thermal(REFERENCE_DEGC, coefficients, (p.get(f"{root}TMIN", 0.0), p.get(f"{root}TMAX", 70.0)))


def _thermal_lines(board: Onboard, name: str, one: Composed) -> tuple[FloatArray, list[str]]:
    """Lines of the sum of both polynomials, and its contribution (3,) to the offset: the polynomial on the board refers
    to the temperature of the board's calibration, the sum to that of this one."""
    held, new = _held_thermal(board, name), one.thermal
    if new is None:
        return np.zeros(3), []
    imu, letters = _names(board, name)
    root = f"INS_TCAL{imu + 1}_"
    total, _ = moved_to(new, REFERENCE_DEGC)
    constant = np.zeros(3)
    if held is not None:
        before = board.parameters.get(f"INS_{letters}{imu + 1}_CALTEMP", REFERENCE_DEGC)
        constant = _at(held, new.reference_degc) - _at(held, before)
        total = total + held.coefficients
    lines = [f"{root}ENABLE,1"]
    lines += range_lines(new, held, root, lambda key, value: f"{key},{number(value)}")
    lines.append(f"INS_{letters}{imu + 1}_CALTEMP,{number(new.reference_degc)}")
    for order in range(3):
        lines += [
            f"{root}{letters}{order + 1}_{a},{number(float(v) / _SCALE)}"
            for a, v in zip(XYZ, total[order], strict=True)
        ]
    lines += [f"# {line}" for line in said_of_misfit(new, name)]
    return constant, lines


def _at(thermal: Thermal, degc: float) -> FloatArray:
    low, high = thermal.range_degc or (degc, degc)
    t = min(max(degc, low), high) - thermal.reference_degc
    return np.asarray(np.array([t, t * t, t**3]) @ thermal.coefficients)


FORMATS = (Format("ardupilot", to_ardupilot, from_ardupilot, in_si=True),)
