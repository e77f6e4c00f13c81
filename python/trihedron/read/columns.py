"""Roles of columns: given by the user, stated by the names, or by position."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.read.clock.unit import TICKS
from trihedron.read.errors import ReadError
from trihedron.read.names import ColumnName, parse_name
from trihedron.read.table import Table
from trihedron.read.unnamed import by_values, forces_of, nanoseconds_beside
from trihedron.records import Finding

Sensor = Literal["accelerometer", "gyroscope"]
Triad = tuple[int, int, int]
Meanings = dict[int, ColumnName]

SENSORS: tuple[Sensor, ...] = ("accelerometer", "gyroscope")
"""Roles of three columns."""
_SINGLE = ("time", "temperature", "supply", "counter", "device")
"""Roles of one column."""
_SENSOR_PREFIXES = {"accelerometer": "a acc acc_ accel accel_ f", "gyroscope": "g w gyr gyr_ gyro_ omega_"}
_ALIASES = {
    **{f"{p}{a}": (sensor, a) for sensor, words in _SENSOR_PREFIXES.items() for p in words.split() for a in "xyz"},
    **{"t": ("time", ""), "timestamp": ("time", ""), "temp": ("temperature", ""), "voltage": ("supply", "")},
    **{"v": ("supply", ""), "n": ("counter", ""), "seq": ("counter", "")},
    **{role: (role, "") for role in _SINGLE},
}
"""Words of ``--columns``: role and axis."""
_BY_PLACE = (3, 4, 6, 7)
"""Numbers of columns for which the order is known without names."""
_FALLS = 0.05
"""Largest share of rows at which a clock goes back, for example because packets of two sensors are late."""
_PLACE = "by place"
"""Group of columns whose order alone says what they are."""
_OWN_CLOCK = 9
"""Rank of a clock among columns without names: the device's, not that of the receiving program."""
MOST_RIVALS = 4
"""Most triads that are listed beside the one taken."""


@dataclass(frozen=True)
class Columns:
    """Column numbers (from 0) by role, units that names state, and findings about the choice."""

    time: int | None = None
    accelerometer: Triad | None = None
    gyroscope: Triad | None = None
    temperature: int | None = None
    supply: int | None = None
    counter: int | None = None
    nanoseconds: int | None = None
    device: int | None = None
    accelerometer_unit: str = ""
    gyroscope_unit: str = ""
    time_unit: str = ""
    positional: bool = False
    findings: tuple[Finding, ...] = ()

    @property
    def readings(self) -> tuple[int, ...]:
        """Columns of both sensors."""
        return (*(self.accelerometer or ()), *(self.gyroscope or ()))

    def used(self) -> set[int]:
        """Columns that are not auxiliary."""
        single = (self.time, self.nanoseconds, self.temperature, self.supply)
        return {column for column in (*single, *self.readings) if column is not None}

    def numbers(self) -> dict[str, float]:
        """Column numbers (from 1) of time and readings by role."""
        triads = {"a": self.accelerometer or (), "g": self.gyroscope or ()}
        time = {} if self.time is None else {"time": self.time + 1.0}
        return time | {
            f"{s}{axis}": c + 1.0 for s, columns in triads.items() for axis, c in zip("xyz", columns, strict=False)
        }

    def mapping(self) -> str:
        """The value of ``--columns`` for time and both sensors."""
        return ",".join(f"{role}={column:.0f}" for role, column in self.numbers().items())


def find_columns(table: Table, mapping: str | None, sensor: Sensor | None) -> Columns:
    """Roles of the columns of a table.

    ``mapping`` is ``"time=t,ax=3,..."`` (names or numbers from 1) or ``"t,ax,ay,az,-,gx,gy,gz"`` (roles in file order);
    ``sensor`` is the sensor of columns named ``x y z`` alone.

    Raises ``ReadError`` when no sensor is found, or the mapping names a column that does not exist.
    """
    said = _said(table, mapping or "", sensor)
    given = {meaning.role for meaning in said.values()}
    findings: list[Finding] = []
    if given.isdisjoint(SENSORS):
        named = {i: _meaning(name, table.columns[i]) for i, name in enumerate(table.names or ())}
        meanings = {i: meaning for i, meaning in named.items() if meaning.role not in given and i not in said} | said
        if not any(_triads(meanings, role) for role in SENSORS):
            meanings |= _by_place(table, meanings, sensor, findings) or _bare(table, meanings, sensor, findings)
    else:
        meanings = said
    triads = {role: _ranked(meanings, role) for role in SENSORS}
    forces = forces_of(table, meanings, *triads.values()) if sensor is None else []
    if forces:
        is_read, taken = not triads["accelerometer"], " ".join(map(table.label, forces[0]))
        findings.append(Finding.of("columns-assumed", "force", taken=taken, is_accelerometer=is_read))
        left = [triad for triad in triads["gyroscope"] if triad not in forces]
        triads = {"accelerometer": triads["accelerometer"] or forces, "gyroscope": left}
    if not triads["accelerometer"] and triads["gyroscope"]:
        triads["accelerometer"] = _ranked(meanings, "translation")  # tx ty tz beside wx wy wz
    if not any(triads.values()):
        raise ReadError(f"{table.path}: {_without_sensor(table)}")
    found: dict[str, Any] = {m.role: i for i, m in sorted(meanings.items(), reverse=True) if m.role in _SINGLE}
    for role, ranked in triads.items():
        if ranked:
            found |= {role: ranked[0], f"{role}_unit": _unit(table, meanings, role, ranked[0])}
    is_placed = any(m.group == _PLACE and m.role in SENSORS for m in meanings.values())
    found |= _clock_columns(table, meanings, said, mapping or "")
    chosen = Columns(**found, positional=is_placed)
    return replace(chosen, findings=(*findings, *_rivals(table, chosen, triads), *_columns_of_words(table, chosen)))


def _meaning(name: str, values: FloatArray) -> ColumnName:
    """What a name says; a column T without a unit that decreases in too many rows for a clock is a temperature."""
    if name.strip() == "T" and np.count_nonzero(np.diff(values) < 0.0) > _FALLS * len(values):
        return ColumnName("temperature")
    return parse_name(name) if len(values) else ColumnName()


def _said(table: Table, mapping: str, sensor: Sensor | None) -> Meanings:
    """What ``--columns`` says of columns; ``time=none`` says nothing here."""
    found: dict[tuple[str, str], int] = {}
    for position, item in enumerate(part.strip() for part in mapping.split(",")):
        word, equals, column = (part.strip() for part in item.partition("="))
        key = word.lower()
        if not equals and key in {"-", "_", "skip", ""}:
            continue
        role = (sensor, key) if key in {"x", "y", "z"} and sensor is not None else _ALIASES.get(key)
        if role is None:
            raise ReadError(
                f"--columns: '{word}' is not a role; "
                "the roles are time, ax ay az, gx gy gz, temperature, supply, counter, device (x y z with one file per "
                "sensor)."
            )
        if column.lower() in {"none", "-"}:
            continue
        name = f"{role[0][0]}{role[1]}" if role[1] else role[0]
        if role in found:
            raise ReadError(f"--columns: {name} is given twice; give each role once.")
        found[role] = _column_number(table, column if equals else str(position + 1), name)
    for kind in SENSORS:
        missing = [f"{kind[0]}{axis}" for axis in "xyz" if (kind, axis) not in found]
        if 0 < len(missing) < 3:
            raise ReadError(f"--columns: the {kind} needs three columns; {' '.join(missing)} is missing.")
    out: Meanings = {}
    for (role_name, axis), i in found.items():
        named = parse_name(table.names[i]) if table.names else ColumnName()
        unit = named.unit if named.role == role_name else ""
        if i in out:
            raise ReadError(f"--columns: column {table.label(i)} is given two roles; give each column one.")
        out[i] = ColumnName(role_name, axis, "", unit, named.time_unit if role_name == "time" else "")
    return out


def _column_number(table: Table, text: str, role: str) -> int:
    names = [name.strip().lower() for name in table.names or ()]
    if text.lower() in names:
        return names.index(text.lower())
    if re.fullmatch(r"\d+", text) and 1 <= int(text) <= len(table.columns):
        return int(text) - 1
    listed = ", ".join(table.names)[:300] if table.names else f"1 to {len(table.columns)}"
    raise ReadError(f"{table.path}: there is no column '{text}' for {role}; the columns are {listed}.")


def _by_place(table: Table, known: Meanings, sensor: Sensor | None, findings: list[Finding]) -> Meanings:
    """Columns without names by their number, else by their values; none where others have names that mean nothing."""
    filled = [
        i
        for i, column in enumerate(table.columns)
        if len(column) and not (table.names and table.names[i]) and not known.get(i, ColumnName()).role
    ]
    # Columns after the last reading that contain no value at all.
    while filled and len(filled) not in _BY_PLACE and not np.isfinite(table.columns[filled[-1]]).any():
        filled.pop()
    n = len(filled)
    if n not in _BY_PLACE or table.sensor is not None:
        found, said = by_values(table, filled, next((i for i, one in known.items() if one.role == "time"), None))
        findings += said
        if found or table.names is not None:
            return found
        raise ReadError(
            f"{table.path}: {n} columns without names could mean anything; "
            "name them, for example --columns time=1,ax=2,ay=3,az=4,gx=5,gy=6,gz=7."
        )
    kinds = SENSORS if n >= 2 * len("xyz") else (sensor or "accelerometer",)
    if len(kinds) == 1 and sensor is None:
        findings.append(Finding.of("columns-assumed", "accelerometer", n_columns=n, is_named=False))
    roles = [*[("time", "")] * (n % 3), *((kind, axis) for kind in kinds for axis in "xyz")]
    return {i: ColumnName(*role, _PLACE, rank=_OWN_CLOCK) for i, role in zip(filled, roles, strict=True)}


def _bare(table: Table, meanings: Meanings, sensor: Sensor | None, findings: list[Finding]) -> Meanings:
    """Columns named only ``x``, ``y``, ``z``, as those of the sensor that the file or their unit names; of a table of
    one sensor, also with a word that says nothing."""
    bare = _triads(meanings, "bare") or (_triads(meanings, "") if table.sensor else [])
    if not bare:
        return {}
    by_unit = [one for one in SENSORS if meanings[bare[0][0]].unit_for(one)]
    told = sensor or sensor_of_file_name(table.path.name) or (by_unit[0] if len(by_unit) == 1 else None)
    if told is None:
        findings.append(Finding.of("columns-assumed", "accelerometer", n_columns=3, is_named=True))
    kind = told or "accelerometer"
    return {i: replace(meanings[i], role=kind, unit=meanings[i].unit_for(kind)) for i in bare[0]}


def sensor_of_file_name(name: str) -> Sensor | None:
    """The sensor that a file's name contains; None where it contains both or neither."""
    says_acc, says_gyro = (re.search(words, name.lower()) for words in ("acc", "gyr|angular|omega|rotationrate"))
    if bool(says_acc) == bool(says_gyro):
        return None
    return "accelerometer" if says_acc else "gyroscope"


def _triads(meanings: Meanings, role: str) -> list[Triad]:
    """Complete groups of ``x``, ``y``, ``z`` columns of one role, in file order."""
    groups: dict[str, dict[str, int]] = {}
    for i, name in sorted(meanings.items()):
        if name.role == role and name.axis:
            groups.setdefault(name.group, {}).setdefault(name.axis, i)
    for key, axes in groups.items():
        stem, bar, unit = key.partition("|")
        # A unit in the name of one axis is that of all: "gx [rad/s], gy, gz".
        without = groups.get(stem + bar, {}) if unit else {}
        if without and len(axes) < len("xyz") and axes.keys().isdisjoint(without):
            axes |= without
    return [
        (axes[labels[0]], axes[labels[1]], axes[labels[2]])
        for axes in groups.values()
        for labels in [next((labels for labels in ("xyz", "012", "123") if axes.keys() >= set(labels)), "")]
        if labels
    ]


def _ranked(meanings: Meanings, role: str) -> list[Triad]:
    """The triad of a role, and those that it could also be, in file order."""
    groups = _triads(meanings, role)
    best = max(groups, key=lambda triad: meanings[triad[0]].rank, default=None)
    return [] if best is None else [best, *(triad for triad in groups if triad != best)]


def _unit(table: Table, meanings: Meanings, sensor: str, triad: Triad) -> str:
    """The unit of a sensor: from the names, else from a remark above the table."""
    units = (meanings[i].unit for i in triad if meanings[i].role == sensor and meanings[i].unit)
    return next(units, table.metadata.get(f"{sensor} unit", ""))


def _clock_columns(table: Table, meanings: Meanings, said: Meanings, mapping: str) -> dict[str, Any]:
    """Time and its unit, as the user, the format and the names say in this order; nanoseconds beside whole seconds; the
    counter of a format."""
    # A program may write an empty column for a clock that it does not have.
    times = [i for i, m in meanings.items() if m.role == "time" and (i in said or np.isfinite(table.columns[i]).any())]
    # Or a constant.
    times = [i for i in times if i in said or table.columns[i][0] != table.columns[i][-1]] or times
    time = max(times, key=lambda i: (meanings[i].rank, -i), default=None)
    found: dict[str, Any] = {"nanoseconds": nanoseconds_beside(table, time)}
    unit = "" if time is None else meanings[time].time_unit
    if unit in ("", TICKS):
        unit = table.metadata.get("time unit", unit)
    stated = table.clock
    if time not in said or time == stated.time:
        time = time if stated.time is None else stated.time
        unit = stated.unit if stated.unit and time is not None else unit
    if stated.counter is not None:
        found["counter"] = stated.counter
    is_ignored = re.search(r"(?:^|,)\s*(?:t|time)\s*=\s*(?:none|-)\s*(?:,|$)", mapping)
    return found | {"time": None if is_ignored else time, "time_unit": unit}


# What is stated of the choice: findings.


def _without_sensor(table: Table) -> str:
    """Why no sensor was found: an axis without numbers, else names that mean none."""
    for column, name in enumerate(table.names or ()):
        role = parse_name(name).role
        if role in SENSORS and not len(table.columns[column]):
            example = f" (such as {table.words[column]!r})" if table.words.get(column) else ""
            return (
                f"column '{name}' of the {role} contains no numbers{example}; correct it, or name another column, for "
                "example --columns time=1,ax=2,ay=3,az=4."
            )
    named = [name for name in table.names or () if name]
    listed = ", ".join(named) or f"{len(table.columns)} columns without names"
    return (
        f"no accelerometer and no gyro columns recognised among: {listed[:300]}; "
        "name them, for example --columns time=1,ax=2,ay=3,az=4,gx=5,gy=6,gz=7."
    )


def _rivals(table: Table, chosen: Columns, triads: dict[Sensor, list[Triad]]) -> Iterator[Finding]:
    """A finding for each sensor that more than one triad could be, with the ``--columns`` of another."""
    for sensor, found in triads.items():
        taken, *others = [" ".join(table.label(c) for c in triad) for triad in found[: MOST_RIVALS + 1]] or [""]
        if others:
            other: dict[str, Any] = {sensor: found[1]}
            mapping = replace(chosen, **other).mapping()
            yield Finding.of(
                "columns-assumed",
                "one-of-several",
                sensor=sensor,
                taken=taken,
                others=others,
                mapping=mapping,
            )


def _columns_of_words(table: Table, columns: Columns) -> Iterator[Finding]:
    """A finding for each column without numbers; a warning where a sensor was not read because of it."""
    for column, example in table.words.items():
        label, cell = table.label(column), example[:40]
        sensor = parse_name(table.names[column]).role if table.names else ""
        if sensor in SENSORS and getattr(columns, sensor) is None:
            yield Finding.of("column-left-out", "axis", column=label, example=cell, sensor=sensor)
        else:
            yield Finding.of("column-left-out", "words", column=label, example=cell)


def statement(table: Table, columns: Columns, file_name: str = "") -> Finding:
    """The finding that states the role of each column, and the columns without a role."""
    roles = []
    for role in ("time", *SENSORS, "temperature", "supply", "counter"):
        value = getattr(columns, role)
        if value is not None:
            which = value if isinstance(value, tuple) else (value,)
            roles.append((role, " ".join(table.label(c) for c in which)))
    used = {*columns.used(), columns.counter}
    rest = [table.label(c) for c in range(len(table.columns)) if c not in used and len(table.columns[c])]
    return Finding.of(
        "columns-recognised",
        has_file=bool(file_name),
        file=file_name,
        roles=roles,
        has_others=bool(rest),
        others=rest[:24],
        numbers=columns.numbers(),
    )
