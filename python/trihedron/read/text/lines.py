"""Lines of a block normalised, counted and separated into rows and remarks, without a Python loop over rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.read.text.layout import Layout

Counts = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Lines:
    """Rows of a block: ``number`` (n,) lines, ``fields`` (n,) numbers of fields; ``comments`` (k,) lines of remarks."""

    number: Counts
    fields: Counts
    text: bytes
    comments: Counts
    last: int
    unclosed: int = 0
    """First line with an unclosed quote; 0 where there is none."""


class RowLines:
    """The line of every row, stored as ranges while no line is excluded."""

    def __init__(self) -> None:
        self.first = 0
        self._next = 0
        self._parts: list[Counts | range] = []

    def append(self, lines: Counts | range) -> None:
        """Add the lines (k,) of the next rows."""
        start, stop = int(lines[0]), int(lines[-1]) + 1
        if not self._parts:
            self.first = start
        is_run = stop - start == len(lines)
        if is_run and self._parts and start == self._next and isinstance(self._parts[-1], range):
            self._parts[-1] = range(self._parts[-1].start, stop)
        else:
            self._parts.append(range(start, stop) if is_run else lines)
        self._next = stop

    def all(self) -> Counts | None:
        """Lines (n,) of all rows; None where they are consecutive."""
        if len(self._parts) == 1 and isinstance(self._parts[0], range):
            return None
        return np.concatenate([np.asarray(part, dtype=np.int64) for part in self._parts])


def regular(data: bytes, layout: Layout) -> bytes:
    """The text with one separator between fields, and no blanks or trailing separators around lines."""
    separator = layout.separator.encode()
    if layout.separator == " ":
        data = data.replace(b"\t", b" ")
    if b" " not in data and not layout.trailing_separator:
        return data
    while b"  " in data:
        data = data.replace(b"    ", b" ").replace(b"  ", b" ")
    data = data.replace(b"\n ", b"\n").replace(b" \n", b"\n").strip(b" ")
    if layout.separator != " ":
        data = data.replace(b" " + separator, separator).replace(separator + b" ", separator)
    if layout.trailing_separator:
        data = (data if data.endswith(b"\n") else data + b"\n").replace(separator + b"\n", b"\n")
    return data


def offset_of_line(data: bytes, line: int) -> int:
    """Offset in bytes of the start of a line (from 1)."""
    offset = 0
    for _ in range(line - 1):
        offset = data.find(b"\n", offset) + 1
    return offset


def data_lines(data: bytes, layout: Layout, lines_before: int) -> Lines:
    """The rows of a block without blank lines and comments; separators inside quotes do not count."""
    raw = np.frombuffer(data, dtype=np.uint8)
    ends = np.flatnonzero(raw == 10)
    starts = np.concatenate([np.zeros(1, dtype=ends.dtype), ends[:-1] + 1])
    numbers = np.arange(lines_before + 1, lines_before + 1 + len(starts), dtype=np.int64)
    first = raw[starts]
    is_blank = first == 10
    # A comment mark of two letters needs both: a single '/' is not a comment.
    second = raw[np.minimum(starts + 1, len(raw) - 1)]
    is_comment = (first == ord("#")) | (first == ord("%")) | ((first == ord("/")) & (second == ord("/")))
    is_separator = raw == ord(layout.separator)
    unclosed = 0
    if b'"' in data:
        inside = _quoted(raw, starts, ends)
        is_separator &= ~inside
        unclosed = int(numbers[np.argmax(inside[ends])]) if inside[ends].any() else 0
    counts = _fields_per_line(is_separator, starts, ends, layout.n_fields)
    keep = ~(is_blank | is_comment)
    comments = numbers[is_comment]
    last = int(numbers[-1])
    if keep.all():
        return Lines(numbers, counts, data, comments, last, unclosed)
    if not keep.any():
        return Lines(numbers[:0], counts[:0], b"", comments, last, unclosed)
    kept = raw[np.repeat(keep, ends - starts + 1)].tobytes()
    return Lines(numbers[keep], counts[keep], kept, comments, last, unclosed)


def _quoted(
    raw: npt.NDArray[np.uint8], starts: npt.NDArray[np.intp], ends: npt.NDArray[np.intp]
) -> npt.NDArray[np.bool_]:
    """Mask of the bytes inside quotes; every line starts outside, so that an unclosed quote affects only its line."""
    opened = np.cumsum(raw == ord('"'))
    before = np.concatenate([np.zeros(1, dtype=opened.dtype), opened[starts[1:] - 1]])
    return np.asarray((opened - np.repeat(before, ends - starts + 1)) % 2 == 1)


def _fields_per_line(
    is_separator: npt.NDArray[np.bool_], starts: npt.NDArray[np.intp], ends: npt.NDArray[np.intp], expected: int
) -> Counts:
    """Number of fields of each line; four times faster in the usual case that all have the expected number."""
    if expected > 1:
        at = np.flatnonzero(is_separator)
        if len(at) == len(starts) * (expected - 1):
            grid = at.reshape(len(starts), expected - 1)
            if np.all(grid[:, 0] >= starts) and np.all(grid[:, -1] < ends):
                return np.full(len(starts), expected, dtype=np.int64)
    return np.add.reduceat(is_separator.view(np.int8), starts, dtype=np.int64) + 1
