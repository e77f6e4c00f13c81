"""Luxonis' depthai: the EEPROM of an OAK camera holds where its IMU sits, and nothing of its readings."""

from __future__ import annotations

from trihedron.files.formats.contract import Format
from trihedron.files.formats.parsing import json_of, without_readings
from trihedron.records import Calibration


def from_depthai(text: str) -> Calibration | None:
    """Refused with what it lacks, since depthai corrects no readings of the IMU.

    Raises
    ------
    ValueError
        When it is such a file.
    """
    if "imuExtrinsics" in (json_of(text) or {}):
        raise without_readings("depthai's JSON of an OAK camera")
    return None


FORMAT = Format("depthai", None, from_depthai)
