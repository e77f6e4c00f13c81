"""HDF5 and MATLAB files: groups of arrays, or tables; the group or table with an accelerometer or a gyro is the log.

Tables and timetables, which are objects in MATLAB files, are decoded by mat-io, one data frame each. MATLAB Mobile
saves a timetable for each sensor (``Acceleration``, ``AngularVelocity``) with columns X, Y, Z.
"""

import pickle
import subprocess
import sys
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron.read.columns import SENSORS, Columns, find_columns, sensor_of_file_name
from trihedron.read.errors import ReadError, errors_of_library, file_sha256, first_bytes, first_line
from trihedron.read.memory import columns_table, frame_columns
from trihedron.read.streams import Stream, choice_note, missing_package, pick
from trihedron.read.table import Options, Table

STARTS = (b"\x89HDF", b"MATLAB")
Groups = dict[str, dict[str, npt.NDArray[Any]]]
MIN_ROWS = 8


def read(path: Path, options: Options) -> tuple[Table, ...]:
    """The log of an HDF5 or MATLAB file, as :func:`_read_hdf5` and :func:`_read_matlab`."""
    first = first_bytes(path, 126)
    # Bytes 125 and 126 of a MATLAB file state whether HDF5 follows, whatever text precedes them.
    is_hdf5_inside = first[124:126] in (b"\x00\x02", b"\x02\x00") or first.startswith(b"MATLAB 7.3")
    is_matlab = first.startswith(b"MATLAB") and not is_hdf5_inside
    return (_read_matlab if is_matlab else _read_hdf5)(path, options)


def _read_hdf5(path: Path, options: Options) -> tuple[Table, ...]:
    """The log of an HDF5 or MATLAB 7.3 file; two tables where MATLAB saved one for each sensor.

    Raises ``ReadError`` when h5py is not installed, the file is damaged, or it is ambiguous which group to read.
    """
    try:
        import h5py
    except ImportError:
        raise missing_package(path, "an HDF5 (or MATLAB 7.3) file", "h5py") from None
    groups: Groups = {}

    def visit(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and (node.dtype.kind in "iufb" or node.dtype.names) and node.size:
            if name.startswith("#"):
                return  # internal data of MATLAB
            parent, _, leaf = name.rpartition("/")
            groups.setdefault(parent, {})[leaf] = node[()]

    with errors_of_library(path, "h5py cannot read this file ({}); copy it again"), h5py.File(path, "r") as file:
        has_objects = "#subsystem#" in file
        file.visititems(visit)
    return _log_of(path, groups, options, "this HDF5 file", has_objects=has_objects)


_LOAD = """
import pickle, sys
sys.path = [folder for folder in sys.path if folder]
from scipy.io import loadmat
pickle.dump(loadmat(sys.argv[1], simplify_cells=True), sys.stdout.buffer, protocol=5)
"""
"""Program that reads a file: SciPy trusts the sizes in it, and a wrong one ends the process in which it is read."""


def _read_matlab(path: Path, options: Options) -> tuple[Table, ...]:
    """The log of a MATLAB file before version 7.3, read by SciPy; tables and timetables are decoded by mat-io.

    Raises ``ReadError`` when the file is damaged, contains only MATLAB objects, or it is ambiguous which structure to
    read.
    """
    child = subprocess.run([sys.executable, "-c", _LOAD, str(path)], capture_output=True, check=False)
    try:
        content = pickle.loads(child.stdout)
    except Exception as error:
        said = child.stderr.decode(errors="replace").strip().split("\n")[-1][:160] or first_line(error)
        raise ReadError(f"{path}: SciPy cannot read this MATLAB file ({said}); save it again.") from None
    groups: Groups = {}
    _walk("", {k: v for k, v in content.items() if not k.startswith("__")}, groups)
    return _log_of(path, groups, options, "this MATLAB file", has_objects="__function_workspace__" in content)


def _walk(name: str, node: Mapping[str, Any], groups: Groups) -> None:
    for key, value in node.items():
        if isinstance(value, Mapping):
            _walk(f"{name}/{key}".strip("/"), value, groups)
        elif isinstance(value, np.ndarray) and value.dtype.kind in "iufb" and value.size:
            groups.setdefault(name, {})[key] = value
        elif isinstance(value, int | float):
            groups.setdefault(name, {})[key] = np.array(value)


def _with_sensors(path: Path, named: Mapping[str, list[tuple[str, Any]]]) -> dict[str, Table]:
    """Tables of named columns in which a sensor is recognised, by name."""
    tables: dict[str, Table] = {}
    for name, columns in named.items():
        with suppress(ReadError):  # lengths differ, or no numbers
            tables[name] = replace(columns_table(str(path), columns), path=path, is_chosen=True)
    found = {name: table for name, table in tables.items() if _columns_or_none(table) is not None}
    by_name = {name: table for name, table in found.items() if table.names and "" not in table.names}
    # One matrix: the roles of its columns follow from their number, or from --columns.
    by_place = found or {name: table for name, table in tables.items() if table.names is None}
    return by_name or (by_place if len(by_place) == 1 else {})


def _columns_or_none(table: Table) -> Columns | None:
    """Roles of the columns of a table; None where no sensor is recognised."""
    try:
        return find_columns(table, None, None)
    except ReadError:
        return None


def _log_of(path: Path, groups: Groups, options: Options, what: str, *, has_objects: bool) -> tuple[Table, ...]:
    """The group or the table (of a file that ``has_objects``) with an accelerometer or a gyro; two with one each."""
    held = ", ".join(f"{g}/{n}".strip("/") for g, arrays in groups.items() for n in arrays)
    tables = _with_sensors(path, {name or "/": _columns(arrays) for name, arrays in groups.items()})
    if has_objects and not tables:
        frames, what = _frames(path), "this MATLAB file"
        held = ", ".join(f"{name} ({type(value).__name__})" for name, value in frames.items())
        named = {
            name: value for name, value in frames.items() if hasattr(value, "columns") and hasattr(value, "dtypes")
        }
        tables = _with_sensors(path, {name: _columns_of_frame(name, frame) for name, frame in named.items()})
    if not tables:
        raise ReadError(
            f"{path}: no arrays named as an accelerometer's or a gyro's in {what}; it contains "
            f"{held[:300] or 'no arrays of numbers'}."
        )
    sha256 = file_sha256(path)
    if options.topic is None and len(tables) == 2:
        found = [(_columns_or_none(table), table) for table in tables.values()]
        by_sensor = {
            "gyroscope" if of and not of.accelerometer else "accelerometer": table for of, table in found if of
        }
        if len(by_sensor) == 2 and not any(of and of.accelerometer and of.gyroscope for of, _ in found):
            return tuple(replace(by_sensor[sensor], sensor=sensor, sha256=sha256) for sensor in SENSORS)
    streams = [Stream(name, table.n_rows) for name, table in tables.items()]
    taken = pick(path, streams, options, what)
    table, note = tables[taken.topic], choice_note(what.removeprefix("this "), taken, streams)
    return (replace(table, sha256=sha256, findings=(*table.findings, *note)),)


def _upright(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The array with MATLAB's 1 x n squeezed and 3 x n transposed."""
    plain = np.squeeze(array)
    return plain.T if plain.ndim == 2 and plain.shape[0] <= 12 < plain.shape[1] else plain


def _columns(arrays: Mapping[str, npt.NDArray[Any]]) -> list[tuple[str, Any]]:
    """Arrays of the group's most frequent length, after :func:`_upright`, and single values."""
    shaped: dict[str, npt.NDArray[Any]] = {}
    for name, array in arrays.items():
        if array.dtype.names:
            shaped |= {field: array[field] for field in array.dtype.names if array[field].ndim == 1}
            continue
        shaped[name] = _upright(array)
    lengths = [a.shape[0] for a in shaped.values() if a.ndim in (1, 2) and a.shape[0] >= MIN_ROWS]
    if not lengths:
        return []
    n = max(set(lengths), key=lengths.count)
    kept = [(name, a) for name, a in shaped.items() if a.ndim in (1, 2) and a.shape[0] == n]
    single = [(name, a) for name, a in shaped.items() if a.ndim == 0]
    return [*kept, *single]


_AXES = {"x", "y", "z"}


def _frames(path: Path) -> dict[str, Any]:
    """Tables and timetables of a MATLAB file as data frames, and its other variables."""
    try:
        from matio import load_from_mat
    except ImportError:
        raise missing_package(path, "a MATLAB file of tables or timetables", "mat-io") from None
    damage = "mat-io cannot read this MATLAB file ({}); save it again"
    with errors_of_library(path, damage), warnings.catch_warnings():
        # SciPy, which mat-io uses, warns about internal data of the objects.
        warnings.simplefilter("ignore")
        return dict(load_from_mat(str(path)))


def _columns_of_frame(name: str, frame: Any) -> list[tuple[str, Any]]:
    """Columns of a data frame; those named only ``x``, ``y``, ``z`` get the name of their table as prefix."""
    items = frame_columns(frame)
    is_bare = {label.lower() for label, _ in items} >= _AXES and sensor_of_file_name(name) is not None
    return [(f"{name}_{label}" if is_bare and label.lower() in _AXES else label, data) for label, data in items]
