"""Parameters of an autopilot as a calibration of the readings that its board logged."""

from dataclasses import replace

from trihedron.files.formats import ardupilot, px4
from trihedron.files.formats.autopilot import against_log
from trihedron.records import Calibration, Onboard
from trihedron.records.plain import from_plain

_CORRECTIONS = {"ardupilot": (ardupilot.correction_of, "AHRS_"), "px4": (px4.correction_of, "SENS_BOARD")}
"""Correction of a sensor by each autopilot, and the beginning of the names of its rotations."""


def as_logged(calibration: Calibration, known: Onboard | None) -> Calibration:
    """S and b that convert logged readings to those under the calibration's board parameters; others are unchanged."""
    stated = calibration.extensions.get("board_parameters")
    if stated is None or known is None or known.stage == "raw":
        return calibration
    held = from_plain(dict(stated), Onboard)  # type: ignore[call-overload]
    if held.autopilot != known.autopilot:
        return calibration
    pairs = against_log(held, known, *_CORRECTIONS[held.autopilot])
    S, b = pairs["accelerometer"]
    gyro = calibration.gyroscope
    if gyro is not None:
        gyro = replace(gyro, S=pairs["gyroscope"][0], b=pairs["gyroscope"][1])
    return replace(calibration, accelerometer=replace(calibration.accelerometer, S=S, b=b), gyroscope=gyro)
