"""The bytes of a text log, decompressed, as plain UTF-8 with one line end; and its lines in regular blocks."""

import bz2
import gzip
import io
import lzma
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.arrays import IntArray
from trihedron.read.errors import ReadError
from trihedron.read.memory import check_unpacked
from trihedron.read.text.layout import COMMENT_STARTS, Layout

BLOCK_BYTES = 1 << 23
"""Bytes parsed at a time: enough for polars to use every core, and little memory (parsing takes about twelve times the
size of a block)."""

_PIECE_BYTES = 1 << 20
_COMPRESSED: dict[bytes, tuple[str, Any]] = {
    b"\x1f\x8b": ("gzip", gzip.open), b"BZh": ("bzip2", bz2.open), b"\xfd7zXZ": ("xz", lzma.open),
}  # fmt: skip
_MINUS = "\u2212".encode()
"""The minus sign that typesetting programs and some spreadsheets write for ``-``."""
_COMMENTS = tuple(mark.encode() for mark in COMMENT_STARTS)
_COLOURS = re.compile(rb"\x1b\[[\d;]*[A-Za-z]")
"""Sequences by which consoles write in colours."""
_QUOTED = re.compile(rb'"[^"]*"')


def unpacked(path: Path, data: bytes) -> bytes:
    """The bytes of a file, decompressed.

    Raises ``ReadError`` when they are damaged, or do not fit into memory.
    """
    name, opened = next((how for start, how in _COMPRESSED.items() if data.startswith(start)), ("", None))
    if opened is None:
        return data
    parts: list[bytes] = []
    size = 0
    try:
        with opened(io.BytesIO(data)) as stream:
            # In pieces, so that the line at which a damaged archive breaks off is known.
            while part := stream.read1(_PIECE_BYTES):
                parts.append(part)
                size += len(part)
                check_unpacked(path, len(data), size)
    except (EOFError, zlib.error, lzma.LZMAError, OSError) as error:
        lines = sum(part.count(b"\n") for part in parts)
        raise ReadError(
            f"{path}: the {name} data is damaged or ends too early, after about {lines} lines "
            f"({error}); copy the file again or unpack its undamaged part."
        ) from None
    return b"".join(parts)


def as_plain(path: Path, data: bytes) -> bytes:
    """Text with a byte order mark, in UTF-16 or with any line ends as plain UTF-8 with line feeds, minus signs as ``-``
    and remarks behind ``;`` as ``#``; binary data, recognised by a zero byte, is rejected."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        data = data.decode("utf-16", errors="replace").encode()
    data = data.removeprefix(b"\xef\xbb\xbf")
    # A search for one byte is ten times faster than one for three, and nearly all logs are ASCII.
    if _MINUS[:1] in data:
        data = data.replace(_MINUS, b"-")
    zero = data.find(b"\x00")
    if zero >= 0:
        raise ReadError(
            f"{path}: line {1 + data.count(10, 0, zero)} contains binary data (a zero byte), so this is not a text "
            "log; convert it to CSV, or delete the damaged lines."
        )
    if b"\x1b[" in data:
        data = _COLOURS.sub(b"", data)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    rows = [line for line in data[: 1 << 16].split(b"\n")[:-1] if line.strip()]
    if rows and all(line.endswith(b";") and line.count(b";") == 1 and b"," in line for line in rows):
        data = data.replace(b";\n", b"\n")
    if data.startswith(b";"):
        # The first line and others that begin so are remarks where no other line contains a semicolon.
        rows = [line for line in data[: 1 << 16].split(b"\n")[:-1] if line.strip() and not line.startswith(b";")]
        if rows and not any(b";" in line for line in rows):
            data = re.sub(rb"(?m)^;", b"#", data)
    return data


def blocks(path: Path, data: bytes, start: int) -> Iterator[tuple[int, int]]:
    """First bytes of parts of a text from byte ``start`` on, and of the next ones; each ends with a complete line."""
    while start < len(data):
        stop = data.find(b"\n", start + BLOCK_BYTES) + 1 or len(data)
        if stop - start > 2 * BLOCK_BYTES:
            raise ReadError(f"{path}: no line end in {(stop - start) / 1e6:.0f} MB: this is not a text log.")
        yield start, stop
        start = stop


@dataclass(frozen=True, eq=False)
class Lines:
    """Rows of a block: ``number`` (n,) lines, ``fields`` (n,) numbers of fields; ``comments`` (k,) lines of remarks;
    ``unclosed``: first line with an unclosed quote, 0 where there is none."""

    number: IntArray
    fields: IntArray
    text: bytes
    comments: IntArray
    unclosed: int


def rows_of(data: bytes, layout: Layout, first_line: int) -> Lines:
    """The rows of a block with one separator between fields, without blanks or separators at their ends, blank lines
    and comments; separators inside quotes do not count."""
    lines = _regular(data, layout).removesuffix(b"\n").split(b"\n")
    comments = [i for i, line in enumerate(lines) if line.startswith(_COMMENTS)]
    is_comment = set(comments)
    number = [i for i, line in enumerate(lines) if line and i not in is_comment]
    rows = [lines[i] for i in number]
    bare = [_QUOTED.sub(b"", row) for row in rows] if b'"' in data else rows
    separator = layout.separator.encode()
    return Lines(
        np.array(number, dtype=np.int64) + first_line,
        np.array([row.count(separator) + 1 for row in bare], dtype=np.int64),
        b"\n".join([*rows, b""]),
        np.array(comments, dtype=np.int64) + first_line,
        next((i + first_line for i, row in zip(number, bare, strict=True) if b'"' in row), 0),
    )


def _regular(data: bytes, layout: Layout) -> bytes:
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
