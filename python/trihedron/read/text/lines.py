"""Lines of a block normalised, counted and separated into rows and remarks."""

import re
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import IntArray
from trihedron.read.text.layout import COMMENT_STARTS, Layout

Counts = IntArray
_COMMENTS = tuple(mark.encode() for mark in COMMENT_STARTS)
_QUOTED = re.compile(rb'"[^"]*"')


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
    lines = data.split(b"\n")[:-1]
    comments = [i for i, line in enumerate(lines) if line.startswith(_COMMENTS)]
    is_comment = set(comments)
    number = [i for i, line in enumerate(lines) if line and i not in is_comment]
    rows = [lines[i] for i in number] if len(number) < len(lines) else lines
    bare = [_QUOTED.sub(b"", row) for row in rows] if b'"' in data else rows
    separator = layout.separator.encode()
    open_quotes = (i for i, row in zip(number, bare, strict=True) if b'"' in row)
    unclosed = next((i + lines_before + 1 for i in open_quotes), 0) if bare is not rows else 0
    return Lines(
        np.array(number, dtype=np.int64) + lines_before + 1,
        np.array([row.count(separator) + 1 for row in bare], dtype=np.int64),
        b"\n".join([*rows, b""]) if len(number) < len(lines) else data,
        np.array(comments, dtype=np.int64) + lines_before + 1,
        lines_before + len(lines),
        unclosed,
    )
