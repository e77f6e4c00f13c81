"""A MATLAB file before 7.3 walked through first: SciPy trusts its sizes, and over wrong ones it ends the program.

Level 5 MAT-files (The MathWorks, MAT-File Format): a header of 128 bytes, then elements of type, size and content; an
array is an element of elements: flags, dimensions, name, and what its class asks for.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod

from trihedron.errors import RefusedError

_SIZE = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Bytes of a value by type of element."""
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED, _UTF8 = 1, 5, 6, 14, 15, 16
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FIRST_NUMBERS = 1, 2, 3, 4, 5, 6
_LAST_NUMBERS, _FUNCTION, _OPAQUE = 15, 16, 17
_HEADER = 128
_DEEPEST = 40
_LONGEST_NAME = 1024


class DamagedError(RefusedError):
    """The walk met what no writer writes; the sentence says where."""


@dataclass(frozen=True)
class _Element:
    kind: int
    start: int
    size: int
    next: int


def check_matlab(content: bytes) -> None:
    """Walk through all arrays of a file.

    Raises
    ------
    DamagedError
        At the first size, type or dimension that does not fit the others.
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
        # Elements end at a multiple of eight bytes, but for compressed ones.
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
    # Each array takes eight bytes at least.
    _expect(count <= (end - at) // 8, at)
    return range(count)


def _expect(is_so: bool, at: int) -> None:
    if not is_so:
        raise DamagedError(f"what stands at byte {at} fits no array")
