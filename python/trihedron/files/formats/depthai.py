"""Luxonis' depthai: the EEPROM of an OAK camera contains the pose of its IMU and no calibration of its readings."""

from __future__ import annotations

from trihedron.files.formats.contract import Format
from trihedron.files.formats.parsing import json_of, without_readings
from trihedron.records import Calibration


def from_depthai(text: str) -> Calibration | None:
    """None for other files; depthai's file is rejected, because it contains no correction of IMU readings.

    Raises
    ------
    ValueError
        When it is depthai's file.
    """
    if "imuExtrinsics" in (json_of(text) or {}):
        raise without_readings("depthai's JSON of an OAK camera")
    return None


FORMATS = (Format("depthai", None, from_depthai),)
