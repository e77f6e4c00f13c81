"""Roles of columns: recognised by name, given by the user, or by position."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.read.clock.unit import TICKS
from trihedron.read.errors import ReadError
from trihedron.read.names import ColumnName, parse_name
from trihedron.read.table import Table
from trihedron.records import Finding, FindingCode

Sensor = Literal["accelerometer", "gyroscope"]
Triad = tuple[int, int, int]

_ALIASES = {
    **{"t": "time", "time": "time", "timestamp": "time"},
    **{f"{p}{a}": f"a{a}" for p in ("a", "acc", "acc_", "accel_", "f") for a in "xyz"},
    **{f"{p}{a}": f"g{a}" for p in ("g", "w", "gyr", "gyr_", "gyro_", "omega_") for a in "xyz"},
    **{"temp": "temperature", "temperature": "temperature", "supply": "supply", "voltage": "supply", "v": "supply"},
    **{"counter": "counter", "n": "counter", "seq": "counter", "device": "device"},
}
_SKIP = {"-", "_", "skip", ""}
SENSORS: tuple[Sensor, ...] = ("accelerometer", "gyroscope")
"""Roles of three columns."""
_SINGLE = ("time", "temperature", "supply", "counter", "device")
"""Roles of one column."""
_BY_PLACE = (3, 4, 6, 7)
"""Numbers of columns for which the order is known without names."""


@dataclass(frozen=True)
class Columns:
    """Column numbers (from 0) by role, units that names state, and findings about the choice.

    ``rivals``: for each sensor, other triads that it could be.
    """

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
    findings: tuple[Finding, ...] = field(default=())
    rivals: Mapping[Sensor, list[Triad]] = field(default_factory=dict)

    @property
    def readings(self) -> tuple[int, ...]:
        """Columns of both sensors."""
        return (*(self.accelerometer or ()), *(self.gyroscope or ()))

    def used(self) -> set[int]:
        """Columns that are not auxiliary."""
        single = (self.time, self.nanoseconds, self.temperature, self.supply)
        return {column for column in (*single, *self.readings) if column is not None}


def find_columns(table: Table, mapping: str | None, sensor: Sensor | None) -> Columns:
    """Roles of the columns of a table.

    ``mapping`` is ``"time=t,ax=3,..."`` (names or numbers from 1) or ``"t,ax,ay,az,-,gx,gy,gz"`` (roles in file order);
    ``sensor`` is the sensor of columns named ``x y z`` alone.

    Raises ``ReadError`` when no sensor is found, or the mapping names a column that does not exist.
    """
    explicit = _mapped(table, mapping, sensor) if mapping is not None and mapping.strip() else None
    if explicit is not None and (explicit.accelerometer or explicit.gyroscope):
        chosen = explicit
    elif table.names is not None:
        chosen = _named(table, sensor)
        if explicit is not None:
            said = {role: column for role in _SINGLE if (column := getattr(explicit, role)) is not None}
            unit = chosen.time_unit if explicit.time is None else explicit.time_unit
            chosen = replace(chosen, **said, time_unit=unit)
    else:
        chosen = _positional(table, sensor)
    chosen = _stated(table, chosen, explicit)
    if mapping is not None and re.search(r"(?:^|,)\s*(?:t|time)\s*=\s*(?:none|-)\s*(?:,|$)", mapping):
        chosen = replace(chosen, time=None)
    if chosen.accelerometer is None and chosen.gyroscope is None:
        raise ReadError(f"{table.path}: {_without_sensor(table)}")
    return chosen


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
    listed = ", ".join(table.names) if table.names else f"{len(table.columns)} columns without names"
    return (
        f"no accelerometer and no gyro columns recognised among: {listed[:300]}; "
        "name them, for example --columns time=1,ax=2,ay=3,az=4."
    )


def columns_or_none(table: Table) -> Columns | None:
    """Roles of the columns of a table; None where no sensor is recognised."""
    try:
        return find_columns(table, None, None)
    except ReadError:
        return None


def _stated(table: Table, chosen: Columns, explicit: Columns | None) -> Columns:
    """Complete ``chosen``: units from the preamble where names state none; clock columns from the format where the
    user names no other."""
    said = table.clock
    is_unstated = chosen.time_unit in ("", TICKS)
    chosen = replace(
        chosen,
        accelerometer_unit=chosen.accelerometer_unit or table.metadata.get("accelerometer unit", ""),
        gyroscope_unit=chosen.gyroscope_unit or table.metadata.get("gyroscope unit", ""),
        time_unit=table.metadata.get("time unit", chosen.time_unit) if is_unstated else chosen.time_unit,
    )
    if said.counter is not None:
        chosen = replace(chosen, counter=said.counter)
    if explicit is not None and explicit.time is not None and explicit.time != said.time:
        return chosen
    if said.time is not None:
        chosen = replace(chosen, time=said.time)
    return replace(chosen, time_unit=said.unit) if said.unit and chosen.time is not None else chosen


def _mapped(table: Table, mapping: str, sensor: Sensor | None) -> Columns:
    roles: dict[str, int] = {}
    for position, item in enumerate(part.strip() for part in mapping.split(",")):
        role_text, equals, column_text = item.partition("=")
        role_key = role_text.strip().lower()
        if not equals:
            if role_key in _SKIP:
                continue
            column_text = str(position + 1)
        role = _ALIASES.get(role_key)
        if role_key in {"x", "y", "z"} and sensor is not None:
            role = f"{sensor[0]}{role_key}"
        if role is None:
            raise ReadError(
                f"--columns: '{role_text.strip()}' is not a role; "
                "the roles are time, ax ay az, gx gy gz, temperature, supply, counter, device (x y z with one file per "
                "sensor)."
            )
        if column_text.strip().lower() in {"none", "-"}:
            continue
        if role in roles:
            raise ReadError(f"--columns: {role} is given twice; give each role once.")
        roles[role] = _column_number(table, column_text.strip(), role)
    found: dict[str, Any] = {role: roles.get(role) for role in _SINGLE}
    named = [parse_name(name) for name in table.names or [""] * len(table.columns)]
    for sensor_name in SENSORS:
        axes = {f"{sensor_name[0]}{axis}": roles.get(f"{sensor_name[0]}{axis}") for axis in "xyz"}
        given = tuple(column for column in axes.values() if column is not None)
        if not given:
            continue
        if len(given) < 3:
            missing = " ".join(axis for axis, column in axes.items() if column is None)
            raise ReadError(f"--columns: the {sensor_name} needs three columns; {missing} is missing.")
        found[sensor_name] = given
        first = named[given[0]]
        found[f"{sensor_name}_unit"] = first.unit if first.role == sensor_name else ""
    time = roles.get("time")
    return Columns(**found, time_unit="" if time is None else named[time].time_unit)


def _column_number(table: Table, text: str, role: str) -> int:
    if table.names is not None:
        exact = [i for i, name in enumerate(table.names) if name.strip().lower() == text.lower()]
        if exact:
            return exact[0]
    if re.fullmatch(r"\d+", text) and 1 <= int(text) <= len(table.columns):
        return int(text) - 1
    listed = ", ".join(table.names)[:300] if table.names else f"1 to {len(table.columns)}"
    raise ReadError(f"{table.path}: there is no column '{text}' for {role}; the columns are {listed}.")


def _positional(table: Table, sensor: Sensor | None) -> Columns:
    """Columns without names: the usual order for their number."""
    filled = [i for i, column in enumerate(table.columns) if len(column) and not (table.names and table.names[i])]
    # Columns after the last reading that contain no value at all.
    while filled and len(filled) not in _BY_PLACE and not np.isfinite(table.columns[filled[-1]]).any():
        filled.pop()
    n = len(filled)
    if n not in _BY_PLACE:
        raise ReadError(
            f"{table.path}: {n} columns without names could mean anything; "
            "name them, for example --columns time=1,ax=2,ay=3,az=4,gx=5,gy=6,gz=7."
        )
    x, y, z, *others = filled[n % 3 :]
    found = Columns(time=filled[0] if n % 3 else None, accelerometer=(x, y, z), positional=True)
    if others:
        return replace(found, gyroscope=(others[0], others[1], others[2]))
    if sensor == "gyroscope":
        return replace(found, accelerometer=None, gyroscope=(x, y, z))
    assumed = () if sensor else (Finding.of(FindingCode.COLUMNS_ASSUMED, "accelerometer", n_columns=n, is_named=False),)
    return replace(found, findings=assumed)


def _named(table: Table, sensor: Sensor | None) -> Columns:
    assert table.names is not None
    parsed = [_column_name(name, values) for name, values in zip(table.names, table.columns, strict=True)]
    notes: list[Finding] = []
    triads: dict[str, Triad | None] = {}
    units: dict[str, str] = {}
    rivals: dict[Sensor, list[Triad]] = {}
    for role in SENSORS:
        groups = _triads(parsed, role)
        triads[role], units[role], rivals[role] = _choose(parsed, groups)
    if triads["accelerometer"] is None and triads["gyroscope"] is not None:
        tilt = _triads(parsed, "translation")  # tx ty tz beside wx wy wz
        if tilt:
            triads["accelerometer"] = tilt[0]
    own_time: int | None = None
    unnamed = sum(1 for i, name in enumerate(table.names) if not name and len(table.columns[i]))
    if not any(triads.values()) and unnamed in _BY_PLACE:
        by_place = _positional(table, sensor)
        triads = {"accelerometer": by_place.accelerometer, "gyroscope": by_place.gyroscope}
        own_time = by_place.time
        notes += by_place.findings
    bare = _triads(parsed, "bare")
    if bare and not any(triads.values()):
        name = parsed[bare[0][0]]
        by_unit: list[Sensor] = [one for one in SENSORS if name.unit_for(one)]
        told = sensor or sensor_of_file_name(table.path.name) or (by_unit[0] if len(by_unit) == 1 else None)
        guess: Sensor = told or "accelerometer"
        triads[guess] = bare[0]
        units[guess] = name.unit_for(guess)
        if told is None:
            notes.append(Finding.of(FindingCode.COLUMNS_ASSUMED, "accelerometer", n_columns=3, is_named=True))
    # A program may write an empty column for a clock that it does not have.
    times = [i for i, p in enumerate(parsed) if p.role == "time" and np.isfinite(table.columns[i]).any()]
    time = max(times, key=lambda i: (parsed[i].rank, -i)) if times else None
    if own_time is not None:
        time = own_time  # the device's clock, not that of the receiving program
    first = {role: next((i for i, p in enumerate(parsed) if p.role == role), None) for role in _SINGLE}
    return Columns(
        **{**first, "time": time},
        accelerometer=triads["accelerometer"],
        gyroscope=triads["gyroscope"],
        nanoseconds=_nanoseconds_beside(table.names, time),
        accelerometer_unit=units["accelerometer"],
        gyroscope_unit=units["gyroscope"],
        time_unit=parsed[time].time_unit if time is not None else "",
        positional=unnamed in (6, 7) and not any(p.role in SENSORS for p in parsed),
        findings=tuple(notes),
        rivals={role: others for role, others in rivals.items() if others},
    )


def _column_name(name: str, values: FloatArray) -> ColumnName:
    """What a name says; a column T without a unit that decreases in too many rows for a clock is a temperature."""
    if name.strip() == "T" and np.count_nonzero(np.diff(values) < 0.0) > _FALLS * len(values):
        return ColumnName("temperature")
    return parse_name(name) if len(values) else ColumnName()


_FALLS = 0.05
"""Largest share of rows at which a clock goes back, for example because packets of two sensors are late."""


def _nanoseconds_beside(names: tuple[str, ...], time: int | None) -> int | None:
    """The column of nanoseconds that belongs to a time column of seconds, as ROS names them (``nsecs``, ``secs``)."""
    if time is None:
        return None
    plain = [re.sub(r"\s*[\[(].*", "", name.strip().lower()) for name in names]
    stem = re.fullmatch(r"(.*?)secs?", plain[time])
    if stem is None:
        return None
    wanted = {f"{stem.group(1)}{word}" for word in ("nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds")}
    return next((i for i, name in enumerate(plain) if name in wanted), None)


def sensor_of_file_name(name: str) -> Sensor | None:
    """The sensor that a file's name contains; None where it contains both or neither."""
    lower = name.lower()
    says_acc, says_gyro = (re.search(words, lower) for words in ("acc", "gyr|angular|omega|rotationrate"))
    if bool(says_acc) == bool(says_gyro):
        return None
    return "accelerometer" if says_acc else "gyroscope"


def _triads(parsed: list[ColumnName], role: str) -> list[Triad]:
    """Complete groups of ``x``, ``y``, ``z`` columns of one role, in file order."""
    groups: dict[str, dict[str, int]] = {}
    for i, name in enumerate(parsed):
        if name.role == role and name.axis:
            groups.setdefault(name.group, {}).setdefault(name.axis, i)
    for key, axes in groups.items():
        stem, bar, unit = key.partition("|")
        # A unit in the name of one axis is that of all: "gx [rad/s], gy, gz".
        without = groups.get(stem + bar, {}) if unit else {}
        if without and len(axes) < len("xyz") and axes.keys().isdisjoint(without):
            axes |= without
    triads: list[Triad] = []
    for axes in groups.values():
        for labels in ("xyz", "012", "123"):
            if all(label in axes for label in labels):
                triads.append((axes[labels[0]], axes[labels[1]], axes[labels[2]]))
                break
    return triads


def _choose(parsed: list[ColumnName], groups: list[Triad]) -> tuple[Triad | None, str, list[Triad]]:
    """The triad of a sensor, its unit, and the triads that were not taken."""
    if not groups:
        return None, "", []
    best = max(groups, key=lambda triad: (parsed[triad[0]].rank, -groups.index(triad)))
    unit = next((parsed[column].unit for column in best if parsed[column].unit), "")
    return best, unit, [triad for triad in groups if triad != best]
