"""MATLAB files: a check of their structure before a library reads them, and MATLAB objects as tables.

The structure of a file before version 7.3 is checked first, because SciPy trusts its sizes and crashes on wrong ones.

Level 5 MAT-files (The MathWorks, MAT-File Format): a header of 128 bytes, then elements of type, size and content; an
array is an element that contains elements: flags, dimensions, name, and further ones that depend on its class.

Tables and timetables, which are objects in MATLAB files, are decoded by mat-io, one data frame each.

MATLAB Mobile saves a timetable for each sensor (``Acceleration``, ``AngularVelocity``) with columns X, Y, Z.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path
from typing import Any

from trihedron.errors import RefusedError
from trihedron.read.columns import Columns, find_columns, sensor_of_file_name
from trihedron.read.devices import Choice
from trihedron.read.digest import file_sha256
from trihedron.read.errors import ReadError
from trihedron.read.memory import columns_table, frame_columns
from trihedron.read.ros import Stream, choice_note, first_line, missing_extra, pick
from trihedron.read.table import Table

_AXES = {"x", "y", "z"}


def read_objects(path: Path, choice: Choice) -> tuple[Table, ...]:
    """The log in a MATLAB file of tables: one table, or one for each sensor.

    Raises
    ------
    ReadError
        When mat-io is not installed, the file is damaged, or several tables could be the log.
    """
    try:
        from matio import load_from_mat
    except ImportError:
        raise missing_extra(path, "a MATLAB file of tables or timetables", "mat-io", "matlab") from None
    try:
        with warnings.catch_warnings():
            # SciPy, which mat-io uses, warns about internal data of the objects.
            warnings.simplefilter("ignore")
            content = load_from_mat(str(path))
    # For damaged files mat-io raises errors of any kind.
    except Exception as error:
        raise ReadError(f"{path}: mat-io cannot read this MATLAB file ({first_line(error)}); save it again.") from None
    tables = {name: table for name, value in content.items() if (table := _table(path, name, value)) is not None}
    found = {name: columns for name, table in tables.items() if (columns := _columns(table)) is not None}
    if not found:
        held = ", ".join(f"{name} ({type(value).__name__})" for name, value in content.items())
        raise ReadError(
            f"{path}: no table named as an accelerometer's or a gyro's in this MATLAB file; it holds {held[:300]}."
        )
    if choice.topic is None:
        acc = [name for name, columns in found.items() if columns.accelerometer and not columns.gyroscope]
        gyr = [name for name, columns in found.items() if columns.gyroscope and not columns.accelerometer]
        if len(acc) == len(gyr) == 1 and len(found) == 2:
            sha256 = file_sha256(path)
            return (
                replace(tables[acc[0]], sensor="accelerometer", sha256=sha256),
                replace(tables[gyr[0]], sensor="gyroscope", sha256=sha256),
            )
    streams = [Stream(name, tables[name].n_rows) for name in found]
    taken = pick(path, streams, choice, "this MATLAB file")
    note = choice_note("MATLAB file", taken, streams)
    table = tables[taken.topic]
    return (replace(table, sha256=file_sha256(path), findings=(*table.findings, *note)),)


def _table(path: Path, name: str, value: Any) -> Table | None:
    """A data frame as a table; columns named only x, y, z get the name of their table as prefix."""
    if not (hasattr(value, "columns") and hasattr(value, "dtypes")):
        return None
    items = frame_columns(value)
    is_bare = {label.lower() for label, _ in items} >= _AXES and sensor_of_file_name(name) is not None
    named = [(f"{name}_{label}" if is_bare and label.lower() in _AXES else label, data) for label, data in items]
    try:
        return replace(columns_table(str(path), named), path=path)
    except ReadError:
        return None


def _columns(table: Table) -> Columns | None:
    try:
        return find_columns(table, None, None)
    except ReadError:
        return None


_SIZE = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Bytes per value by element type."""
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED, _UTF8 = 1, 5, 6, 14, 15, 16
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FIRST_NUMBERS = 1, 2, 3, 4, 5, 6
_LAST_NUMBERS, _FUNCTION, _OPAQUE = 15, 16, 17
_HEADER = 128
_DEEPEST = 40
_LONGEST_NAME = 1024


class DamagedError(RefusedError):
    """The structure of the file is invalid; the message says where."""


@dataclass(frozen=True)
class _Element:
    kind: int
    start: int
    size: int
    next: int


def check_matlab(content: bytes) -> None:
    """Check all arrays of a file.

    Raises
    ------
    DamagedError
        At the first size, type or dimension that is inconsistent.
    """
    order = "<" if content[126:128] == b"IM" else ">"
    for element in _elements(content, _HEADER, len(content), order):
        if element.kind == _COMPRESSED:
            try:
                inside = zlib.decompress(content[element.start : element.start + element.size])
            except zlib.error as error:
                raise DamagedError(f"compressed array at byte {element.start}: {error}") from None
            first = _element(inside, 0, len(inside), order)
            _expect(first.kind == _MATRIX, element.start)
            _matrix(inside, first.start, first.start + first.size, order, 0)
        else:
            _expect(element.kind == _MATRIX, element.start)
            _matrix(content, element.start, element.start + element.size, order, 0)


def _elements(data: bytes, at: int, end: int, order: str) -> Iterator[_Element]:
    while at < end:
        element = _element(data, at, end, order)
        yield element
        at = element.next


def _element(data: bytes, at: int, end: int, order: str) -> _Element:
    _expect(at + 8 <= end, at)
    (word,) = struct.unpack_from(order + "I", data, at)
    if word >> 16:
        kind, size, start, following = word & 0xFFFF, word >> 16, at + 4, at + 8
        _expect(size <= 4, at)
    else:
        (size,) = struct.unpack_from(order + "I", data, at + 4)
        kind, start = word, at + 8
        # Elements are padded to a multiple of eight bytes, except compressed ones.
        following = start + size + (0 if kind == _COMPRESSED else -size % 8)
    _expect(start + size <= end, at)
    return _Element(kind, start, size, min(following, end))


def _matrix(data: bytes, at: int, end: int, order: str, depth: int) -> None:
    _expect(depth < _DEEPEST, at)
    if at == end:
        return

    def take(*kinds: int) -> _Element:
        nonlocal at
        element = _element(data, at, end, order)
        _expect(not kinds or element.kind in kinds, at)
        at = element.next
        return element

    flags = take(_UINT32)
    _expect(flags.size == 8, flags.start)
    (word,) = struct.unpack_from(order + "I", data, flags.start)
    kind, is_complex = word & 0xFF, bool(word & 0x800)
    if kind == _OPAQUE:
        for _ in range(3):
            take(_INT8)
        _inner(data, take(_MATRIX), order, depth)
        return
    shape = take(_INT32)
    _expect(shape.size >= 8 and shape.size % 4 == 0 and shape.size <= 128, shape.start)
    dimensions = struct.unpack_from(f"{order}{shape.size // 4}i", data, shape.start)
    _expect(min(dimensions) >= 0, shape.start)
    count = prod(dimensions)
    _expect(take(_INT8, _UTF8).size <= _LONGEST_NAME, at)
    if kind in (_CELL, _FUNCTION):
        for _ in _counted(count if kind == _CELL else 1, at, end):
            _inner(data, take(_MATRIX), order, depth)
    elif kind in (_STRUCT, _OBJECT):
        if kind == _OBJECT:
            take(_INT8)
        length = take(_INT32)
        _expect(length.size == 4, length.start)
        (width,) = struct.unpack_from(order + "i", data, length.start)
        names = take(_INT8)
        _expect(0 < width <= _LONGEST_NAME and names.size % width == 0, names.start)
        for _ in _counted(count * (names.size // width), at, end):
            _inner(data, take(_MATRIX), order, depth)
    elif kind == _SPARSE:
        rows, columns = take(_INT32), take(_INT32)
        _expect(len(dimensions) == 2 and columns.size == 4 * (dimensions[1] + 1), columns.start)
        _expect(take(*_SIZE).size >= 0 and rows.size % 4 == 0, rows.start)
    elif kind == _CHAR:
        text = take(*_SIZE)
        _expect(text.kind == _UTF8 or text.size == count * _SIZE[text.kind], text.start)
    else:
        _expect(_FIRST_NUMBERS <= kind <= _LAST_NUMBERS, flags.start)
        for _ in range(2 if is_complex else 1):
            values = take(*_SIZE)
            _expect(values.size == count * _SIZE[values.kind], values.start)


def _inner(data: bytes, element: _Element, order: str, depth: int) -> None:
    _matrix(data, element.start, element.start + element.size, order, depth + 1)


def _counted(count: int, at: int, end: int) -> range:
    # Each array takes at least eight bytes.
    _expect(count <= (end - at) // 8, at)
    return range(count)


def _expect(is_so: bool, at: int) -> None:
    if not is_so:
        raise DamagedError(f"what stands at byte {at} fits no array")
