"""Units that the lines above a table state: ``# acceleration in g, angular rate in deg/h``."""

from __future__ import annotations

import re
from collections.abc import Iterable

from trihedron.read.names import sensor_said, unit_said

_CLAUSE = re.compile(r"[;,]|\band\b")
_STATEMENT = re.compile(r"^\W*(?P<what>[^:=\[(]+?)\s*(?:\bin\b|[:=\[(])\s*(?P<unit>[^\[\]()]+?)\s*[\])]?\s*$")


def stated_units(lines: Iterable[str]) -> dict[str, str]:
    """Unit of each sensor as stated, under ``accelerometer unit`` and ``gyroscope unit``; the first statement counts.

    A clause says what (a sensor and no more, perhaps the word unit) and its unit: ``accelerometer range: 4 g`` and
    ``gyro bias: 0.1 deg/s`` state none of the readings.
    """
    found: dict[str, str] = {}
    for line in lines:
        for clause in _CLAUSE.split(line.lower().strip(" #%/\r")):
            said = _STATEMENT.match(clause)
            sensor = sensor_said(said["what"]) if said else ""
            unit = unit_said(sensor, said["unit"]) if said and sensor else ""
            if unit:
                found.setdefault(f"{sensor} unit", unit)
    return found
