"""Columns left aside that turn as gravity does: a gyro under a name that says nothing."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.read.column_statement import mapping_of
from trihedron.read.columns import Triad
from trihedron.read.sensors import Sensors
from trihedron.read.turning import turning_of
from trihedron.records import Finding, FindingCode

CLEAR_CORRELATION = 0.5
"""Of gravity's change with that predicted from three columns as rates: a gyro's lies above (0.74 in a hand that also
accelerates), that of angles, fields and velocities below 0.1 (tests/test_read_unusual.py)."""
FEWEST_PAIRS = 50
"""Blocks in motion, below which chance may correlate; 0.5 is then three and a half standard errors of a correlation."""


def unnamed_gyro(sensors: Sensors, rate_hz: float) -> tuple[Finding, ...]:
    """A warning for each triad of columns without a known name that turns with the accelerometer's gravity.

    Only where no gyro was recognised; gravity's change in blocks against ``-ω × a`` (``turning_of``).
    """
    accelerometer, table, columns = sensors.accelerometer, sensors.table, sensors.columns
    if accelerometer is None or sensors.gyroscope is not None or columns.accelerometer is None or table.names is None:
        return ()
    found = []
    n = len(accelerometer)
    for triad in _triads(table.names, {i for i, c in enumerate(table.columns) if not len(c)} | columns.used()):
        rates = np.stack([_kept(sensors, column, n) for column in triad], axis=1)
        turning = turning_of(accelerometer, rates, rate_hz)
        if turning is None or turning.correlation <= CLEAR_CORRELATION or turning.n < FEWEST_PAIRS:
            continue
        mapping = mapping_of(columns, triad)
        listed = " ".join(table.label(column) for column in triad)
        found.append(Finding.of(FindingCode.COLUMNS_ASSUMED, "unnamed-gyro", taken=listed, mapping=mapping))
    return tuple(found)


def _kept(sensors: Sensors, column: int, n: int) -> FloatArray:
    values = sensors.table.columns[column]
    values = values if sensors.rows is None else values[sensors.rows]
    return values[sensors.offset : sensors.offset + n]


def _triads(names: tuple[str, ...], taken: set[int]) -> list[Triad]:
    """Columns whose names differ in one letter only: x, y, z."""
    left = {name.strip().lower(): i for i, name in enumerate(names) if i not in taken}
    out: list[Triad] = []
    for name, i in left.items():
        for k in (k for k, letter in enumerate(name) if letter == "x"):
            others = [left.get(f"{name[:k]}{axis}{name[k + 1 :]}") for axis in "yz"]
            if others[0] is not None and others[1] is not None:
                out.append((i, others[0], others[1]))
    return out
