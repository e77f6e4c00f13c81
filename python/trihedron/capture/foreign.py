"""What is not decoded: named by the beginnings of its messages, with the way in."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import pairwise

_AS_LOG = "read the log itself with `trihedron check`"
_FILES: tuple[tuple[bytes, str, str], ...] = (
    (rb"....ftyp", "a video", "write its motion data as CSV (GoPro's with gopro-telemetry) and check that"),
    (rb"DEVC\0", "a GoPro GPMF stream", "write its ACCL and GYRO as CSV with gopro-telemetry and check that"),
    (rb"ULog|\xa3\x95\x80", "a log of an autopilot", _AS_LOG),
    (rb"#ROSBAG|\x89MCAP|SQLite ", "a bag of ROS", _AS_LOG),
)
_STREAMS: tuple[tuple[bytes, str, str], ...] = (
    (
        rb"\$VN[A-Z]{3},",
        "VectorNav text without acceleration and rate",
        "send $VNWRG,06,19*XX to the sensor for $VNIMU lines",
    ),
    (
        rb"\xff\x5a[\x00-\x3f]\x00",
        "SBG sbgECom without IMU data",
        "switch the message IMU data (3) on in sbgCenter",
    ),
    (
        rb"\x55\x61.{18}(?=\x55)",
        "WitMotion's Bluetooth packets, which carry no checksum",
        "connect the sensor by its serial port",
    ),
    (
        rb"\x55[\x53-\x5f].{9}(?=\x55)",
        "WitMotion packets without acceleration and rate",
        "switch both on in the maker's program",
    ),
    (rb"\xfa\xff\x32", "Xsens MTData of the old kind", "set the sensor to MTData2 in MT Manager"),
    (rb"ue[\x80-\x9f]", "MicroStrain MIP", "record it with SensorConnect and check the CSV"),
    (rb"\xb5b\x10", "u-blox messages", "convert ESF-RAW to CSV and check that"),
    (rb"\xaaD[\x12\x13]", "NovAtel binary messages", "log RAWIMUSA as text and check that"),
    (rb"#RAWIMU|%RAWIMU", "NovAtel text", "save it to a file and check that"),
    (rb"\xfd.[\x00\x01]\x00", "MAVLink", "download the autopilot's log and check that"),
    (rb"\$(?:G[PNALB]|BD)[A-Z]{3},", "NMEA text of a receiver, which holds no IMU", "name the port of the IMU"),
)
MOST_BETWEEN = 2048
"""Bytes between two messages: in noise two given bytes are met every 65 536."""


def foreign(heard: Iterable[bytes]) -> tuple[str, str] | None:
    """What one of the pieces is, and what to do instead; None where nothing known begins its messages."""
    for data in heard:
        for start, kind, remedy in _FILES:
            if re.match(start, data, re.DOTALL):
                return kind, remedy
        for start, kind, remedy in _STREAMS:
            n = len(re.findall(start, data, re.DOTALL))
            if n >= max(3, len(data) // MOST_BETWEEN):
                return kind, remedy
        if _of_one_layout(data):
            return "VectorNav binary output", "send $VNWRG,06,19*XX to the sensor for $VNIMU lines"
    return None


def _of_one_layout(data: bytes) -> bool:
    """0xFA, groups, fields: the same four bytes at one distance from message to message."""
    for head in {match[0] for match in re.finditer(rb"\xfa[\x01-\x3f]..", data, re.DOTALL)}:
        places = [match.start() for match in re.finditer(re.escape(head), data)]
        steps = [b - a for a, b in pairwise(places)]
        if len(steps) >= 3 and steps.count(steps[0]) > 0.8 * len(steps) and steps[0] < MOST_BETWEEN:
            return True
    return False
