"""Lines of a block normalised, counted and separated into rows and remarks."""

import re
from collections.abc import Sequence
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


def lines_of_rows(parts: Sequence[Counts | range]) -> tuple[int, Counts | None]:
    """Line of the first row, and lines (n,) of all rows, given block by block; None where they are consecutive."""
    first, n = int(parts[0][0]), sum(map(len, parts))
    if all(isinstance(part, range) for part in parts) and int(parts[-1][-1]) - first + 1 == n:
        return first, None
    return first, np.concatenate([np.asarray(part, dtype=np.int64) for part in parts])


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
