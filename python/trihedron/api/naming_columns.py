"""Columns of a board's stream get the names that :func:`trihedron.read` would give them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from trihedron.arrays import AXES
from trihedron.errors import InputError
from trihedron.protocols.lines import LineColumns, NameColumns
from trihedron.read.clock.unit import TICKS, Witness, parse_time_unit, seconds_of
from trihedron.read.clock.unit import time_unit as likely_unit
from trihedron.read.columns import Columns, find_columns
from trihedron.read.table import Table

Cells = npt.NDArray[np.float64]


def column_namer(mapping: str | None = None, time_unit: str | None = None) -> NameColumns:
    """Roles of the fields of text lines, as in a log; ``mapping`` and ``time_unit`` are those of ``read``."""
    given = None if time_unit is None else parse_time_unit(time_unit)

    def name(names: tuple[str, ...] | None, rows: list[list[str]]) -> LineColumns:
        cells = np.array([[_number(cell) for cell in row] for row in rows])
        table = Table(Path("the stream"), names, tuple(np.ascontiguousarray(column) for column in cells.T))
        try:
            columns = find_columns(table, mapping, None)
        except InputError:
            if mapping is not None:
                raise
            columns = _by_content(cells) if names is None else Columns()
        stated = given or columns.time_unit.replace(TICKS, "")
        if columns.time is not None and not stated and _counts_lines(cells[:, columns.time]):
            # Samples, or milliseconds at exactly 1 kHz: a counter shows losses, and the host's clock gives the rate.
            columns = replace(columns, time=None, counter=columns.time)
        if columns.time is not None and not stated:
            raw = cells[:, columns.time]
            stated = likely_unit(raw[np.isfinite(raw)], "", None, False, Witness(), [])
        labels = _labels(columns, names, cells.shape[1], is_mapped=mapping is not None)
        return LineColumns(labels, columns.time, seconds_of(stated or "ms"), columns.counter)

    return name


def sensor_columns(columns: tuple[str, ...]) -> list[int]:
    """Indices of the accelerometer's columns, then the gyro's, among the columns of a stream.

    Raises ``InputError`` when there is no accelerometer.
    """
    empty = tuple(np.zeros(1) for _ in columns)
    found = find_columns(Table(Path("the stream"), columns, empty), None, None)
    if found.accelerometer is None:
        raise InputError("the board sends no accelerometer that is recognised; name its columns with --columns.")
    return [*found.accelerometer, *(found.gyroscope or ())]


def _labels(columns: Columns, names: tuple[str, ...] | None, n: int, *, is_mapped: bool) -> tuple[str, ...]:
    labels = [f"column_{i + 1}" for i in range(n)] if names is None else [name.replace(",", " ") for name in names]
    if names is not None and not is_mapped:
        return tuple(labels)
    for letter, triad in (("a", columns.accelerometer), ("g", columns.gyroscope)):
        for axis, column in zip(AXES, triad or (), strict=False):
            labels[column] = f"{letter}{axis}"
    for label, place in (("temperature", columns.temperature), ("supply", columns.supply)):
        if place is not None:
            labels[place] = label
    return tuple(labels)


def _by_content(cells: Cells) -> Columns:
    """Roles by content, for a stream joined after its header: a column that rises by one is the counter, another that
    always rises is the time, the next six are the triads. Other columns keep their place without a role."""
    steps = np.diff(cells, axis=0)
    growing = [i for i in range(cells.shape[1]) if len(steps) and np.all(steps[:, i] > 0)]
    counter = next((i for i in growing if np.median(steps[:, i]) == 1.0), None)
    time = next((i for i in growing if i != counter), None)
    rest = [i for i in range(cells.shape[1]) if i not in growing]
    triads = [(rest[k], rest[k + 1], rest[k + 2]) for k in (0, 3) if len(rest) >= k + 3]
    return Columns(
        time=time,
        counter=counter,
        accelerometer=triads[0] if triads else None,
        gyroscope=triads[1] if len(triads) > 1 else None,
    )


def _counts_lines(values: Cells) -> bool:
    """Whether numbers (n,) rise by one from line to line, except where lines are lost or the counter wraps."""
    steps = np.diff(values)
    return len(steps) > 1 and bool(np.mean(steps == 1.0) > 0.7) and bool(np.all(values == np.rint(values)))


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan
