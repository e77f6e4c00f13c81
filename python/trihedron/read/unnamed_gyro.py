"""Columns without a role whose readings rotate as gravity does: a gyro with an unknown name."""

from __future__ import annotations

import numpy as np

from trihedron.read.column_statement import mapping_of
from trihedron.read.columns import Triad
from trihedron.read.sensors import Sensors
from trihedron.read.turning import turning_of
from trihedron.records import Finding, FindingCode

CLEAR_CORRELATION = 0.5
"""Correlation of gravity's change with that predicted from three columns as rates: a gyro's is higher (0.74 for a hand
that also accelerates), that of angles, fields and velocities below 0.1 (tests/test_read_unusual.py)."""
FEWEST_PAIRS = 50
"""Smallest number of blocks in motion, for which 0.5 is three and a half standard errors of a correlation."""


def unnamed_gyro(sensors: Sensors, rate_hz: float) -> tuple[Finding, ...]:
    """A warning for each triad of columns with unknown names whose readings rotate as the accelerometer's gravity does.

    Only where no gyro is recognised; gravity's change in blocks is compared with ``-ω × a`` (``turning_of``).
    """
    accelerometer, table, columns = sensors.accelerometer, sensors.table, sensors.columns
    if accelerometer is None or sensors.gyroscope is not None or columns.accelerometer is None or table.names is None:
        return ()
    found = []
    for triad in _triads(table.names, {i for i, c in enumerate(table.columns) if not len(c)} | columns.used()):
        rates = np.stack([sensors.column(column) for column in triad], axis=1)
        turning = turning_of(accelerometer, rates, rate_hz)
        if turning is None or turning.correlation <= CLEAR_CORRELATION or turning.n < FEWEST_PAIRS:
            continue
        mapping = mapping_of(columns, triad)
        listed = " ".join(table.label(column) for column in triad)
        found.append(Finding.of(FindingCode.COLUMNS_ASSUMED, "unnamed-gyro", taken=listed, mapping=mapping))
    return tuple(found)


def _triads(names: tuple[str, ...], taken: set[int]) -> list[Triad]:
    """Triads of columns whose names differ only in one letter: x, y, z."""
    left = {name.strip().lower(): i for i, name in enumerate(names) if i not in taken}
    out: list[Triad] = []
    for name, i in left.items():
        for k in (k for k, letter in enumerate(name) if letter == "x"):
            others = [left.get(f"{name[:k]}{axis}{name[k + 1 :]}") for axis in "yz"]
            if others[0] is not None and others[1] is not None:
                out.append((i, others[0], others[1]))
    return out
