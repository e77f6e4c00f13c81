"""Splits a table whose rows contain either the accelerometer or the gyro, with the other's cells empty, into two."""

import numpy as np

from trihedron.arrays import BoolArray, IntArray
from trihedron.read.columns import Sensor, Triad, find_columns
from trihedron.read.errors import ReadError
from trihedron.read.table import Table
from trihedron.records import Finding

_LOOKED_AT = 1000
_USUALLY_BOTH = 0.9
"""Share of the first rows with both sensors above which the table is not split: missing readings are lost ones."""
_SELDOM_BOTH = 0.5
"""Largest share of a sensor's rows that also contain the other; timestamps of two clocks coincide now and then."""
_IN_STEP = 0.9
"""Smallest share of a slower sensor's rows at a constant distance in rows."""


def by_rows(table: Table, mapping: str | None, sensor: Sensor | None) -> tuple[Table, ...]:
    """The accelerometer's rows and the gyro's, where they alternate, or where one fills only every second, third ...
    row; else the table itself.

    Raises ``ReadError`` when rows alternate and no column contains their time, or as ``find_columns``.
    """
    chosen = find_columns(table, mapping, sensor or table.sensor)
    if chosen.accelerometer is None or chosen.gyroscope is None:
        return (table,)
    triads = (chosen.accelerometer, chosen.gyroscope)
    acc, gyr = (_has_reading(table, triad, _LOOKED_AT) for triad in triads)
    if np.mean(acc & gyr) >= _USUALLY_BOTH:
        return (table,)
    acc, gyr = (_has_reading(table, triad, None) for triad in triads)
    rows = [np.flatnonzero(has).astype(np.int64) for has in (acc, gyr)]
    fewest = min(len(r) for r in rows)
    take_turns = np.count_nonzero(acc & gyr) <= _SELDOM_BOTH * fewest
    if fewest < 2 or not (take_turns or any(_is_every_other(r) for r in rows)):
        return (table,)
    if chosen.time is None:
        raise ReadError(
            f"{table.path}: rows hold the accelerometer ({len(rows[0])}) or the gyro ({len(rows[1])}) in turn, and no "
            "column contains the time that would join them; log a time in each row, or both sensors in one row."
        )
    left = int(np.count_nonzero(~(acc | gyr)))
    note = Finding.of(
        "device-chosen",
        "in-turn",
        accelerometer_rows=len(rows[0]),
        gyroscope_rows=len(rows[1]),
        rows_left_out=left,
    )
    if chosen.counter is not None and np.median(np.diff(table.columns[chosen.counter])) == 1.0:
        # By a counter of all rows those of the other sensor would count as lost.
        table = table.without({chosen.counter})
    first, second = table.by_sensor(rows[0], rows[1], left, note)
    return _filled(first), _filled(second)


def _has_reading(table: Table, triad: Triad, most: int | None) -> BoolArray:
    cells = [np.isfinite(table.columns[i][:most]) for i in triad if len(table.columns[i])]
    return np.asarray(np.any(cells, axis=0), dtype=np.bool_)


def _is_every_other(rows: IntArray) -> bool:
    step = np.diff(rows)
    usual = int(np.median(step))
    return usual > 1 and bool(np.mean(step == usual) >= _IN_STEP)


def _filled(table: Table) -> Table:
    """The table without the columns that are empty in these rows."""
    return table.without({i for i, c in enumerate(table.columns) if not (len(c) and np.isfinite(c).any())})
