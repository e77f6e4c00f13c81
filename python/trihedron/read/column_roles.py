"""The roles of a table's columns, as a finding and as the value of ``--columns``."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from trihedron.read.columns import SENSORS, Columns, Triad
from trihedron.read.names import parse_name
from trihedron.read.table import Table
from trihedron.records import Finding, FindingCode

MOST_RIVALS = 4
"""Most triads that are listed beside the one taken."""


def columns_of_words(table: Table, columns: Columns) -> Iterator[Finding]:
    """A finding for each column without numbers; a warning where a sensor was not read because of it."""
    for column, example in table.words.items():
        label, cell = table.label(column), example[:40]
        sensor = parse_name(table.names[column]).role if table.names else ""
        if sensor in SENSORS and getattr(columns, sensor) is None:
            yield Finding.of(FindingCode.COLUMN_LEFT_OUT, "axis", column=label, example=cell, sensor=sensor)
        else:
            yield Finding.of(FindingCode.COLUMN_LEFT_OUT, "words", column=label, example=cell)


def numbers_of(columns: Columns) -> dict[str, float]:
    """Column numbers (from 1) of time and readings by role."""
    triads = {"a": columns.accelerometer or (), "g": columns.gyroscope or ()}
    time = {} if columns.time is None else {"time": columns.time + 1.0}
    return time | {f"{s}{axis}": c + 1.0 for s, triad in triads.items() for axis, c in zip("xyz", triad, strict=False)}


def mapping_of(columns: Columns, gyroscope: Triad | None = None) -> str:
    """The value of ``--columns`` for time and both sensors; ``gyroscope`` is used where ``columns`` has no gyro."""
    said = numbers_of(replace(columns, gyroscope=columns.gyroscope or gyroscope))
    return ",".join(f"{role}={column:.0f}" for role, column in said.items())


def rivals_of(table: Table, columns: Columns) -> Iterator[Finding]:
    """A finding for each sensor that more than one triad could be, with the ``--columns`` of another."""
    for sensor, rivals in columns.rivals.items():
        taken = " ".join(table.label(c) for c in getattr(columns, sensor))
        others = [" ".join(table.label(c) for c in triad) for triad in rivals[:MOST_RIVALS]]
        other: dict[str, Any] = {sensor: rivals[0]}
        yield Finding.of(
            FindingCode.COLUMNS_ASSUMED,
            "one-of-several",
            sensor=sensor,
            taken=taken,
            others=others,
            mapping=mapping_of(replace(columns, **other)),
        )


def statement(table: Table, columns: Columns, file_name: str = "") -> Finding:
    """The finding that states the role of each column, and the columns without a role."""
    roles = []
    for role in ("time", "accelerometer", "gyroscope", "temperature", "supply", "counter"):
        value = getattr(columns, role)
        if value is not None:
            which = value if isinstance(value, tuple) else (value,)
            roles.append((role, " ".join(table.label(c) for c in which)))
    used = {*columns.used(), columns.counter}
    rest = [table.label(c) for c in range(len(table.columns)) if c not in used and len(table.columns[c])]
    return Finding.of(
        FindingCode.COLUMNS_RECOGNISED,
        has_file=bool(file_name),
        file=file_name,
        roles=roles,
        has_others=bool(rest),
        others=rest[:24],
        numbers=numbers_of(columns),
    )
