"""MATLAB objects as tables.

Tables and timetables, which are objects in MATLAB files, are decoded by mat-io, one data frame each.

MATLAB Mobile saves a timetable for each sensor (``Acceleration``, ``AngularVelocity``) with columns X, Y, Z.
"""

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

from trihedron.read.columns import columns_or_none, sensor_of_file_name
from trihedron.read.devices import Choice
from trihedron.read.errors import ReadError, errors_of_library, file_sha256
from trihedron.read.memory import columns_table, frame_columns
from trihedron.read.ros import Stream, choice_note, missing_package, pick
from trihedron.read.table import Table

_AXES = {"x", "y", "z"}


def read_objects(path: Path, choice: Choice) -> tuple[Table, ...]:
    """The log in a MATLAB file of tables: one table, or one for each sensor.

    Raises ``ReadError`` when mat-io is not installed, the file is damaged, or several tables could be the log.
    """
    try:
        from matio import load_from_mat
    except ImportError:
        raise missing_package(path, "a MATLAB file of tables or timetables", "mat-io") from None
    damage = "mat-io cannot read this MATLAB file ({}); save it again"
    with errors_of_library(path, damage), warnings.catch_warnings():
        # SciPy, which mat-io uses, warns about internal data of the objects.
        warnings.simplefilter("ignore")
        content = load_from_mat(str(path))
    tables = {name: table for name, value in content.items() if (table := _table(path, name, value)) is not None}
    found = {name: columns for name, table in tables.items() if (columns := columns_or_none(table)) is not None}
    if not found:
        held = ", ".join(f"{name} ({type(value).__name__})" for name, value in content.items())
        raise ReadError(
            f"{path}: no table named as an accelerometer's or a gyro's in this MATLAB file; it contains {held[:300]}."
        )
    sha256 = file_sha256(path)
    if choice.topic is None:
        acc = [name for name, columns in found.items() if columns.accelerometer and not columns.gyroscope]
        gyr = [name for name, columns in found.items() if columns.gyroscope and not columns.accelerometer]
        if len(acc) == len(gyr) == 1 and len(found) == 2:
            return (
                replace(tables[acc[0]], sensor="accelerometer", sha256=sha256),
                replace(tables[gyr[0]], sensor="gyroscope", sha256=sha256),
            )
    streams = [Stream(name, tables[name].n_rows) for name in found]
    taken = pick(path, streams, choice, "this MATLAB file")
    note = choice_note("MATLAB file", taken, streams)
    table = tables[taken.topic]
    return (replace(table, sha256=sha256, findings=(*table.findings, *note)),)


def _table(path: Path, name: str, value: Any) -> Table | None:
    """A data frame as a table; columns named only ``x``, ``y``, ``z`` get the name of their table as prefix."""
    if not (hasattr(value, "columns") and hasattr(value, "dtypes")):
        return None
    items = frame_columns(value)
    is_bare = {label.lower() for label, _ in items} >= _AXES and sensor_of_file_name(name) is not None
    named = [(f"{name}_{label}" if is_bare and label.lower() in _AXES else label, data) for label, data in items]
    try:
        return replace(columns_table(str(path), named), path=path)
    except ReadError:
        return None
