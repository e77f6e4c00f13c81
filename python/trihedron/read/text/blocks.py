"""The bytes of a text log: decompressed, in blocks of complete lines, as plain UTF-8."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import re
import zlib
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from trihedron.read.errors import ReadError, from_os_error
from trihedron.read.memory import check_ratio

BLOCK_BYTES = 1 << 23
"""Bytes parsed at a time: enough for polars to use every core, and little memory (parsing takes about twelve times the
size of a block)."""

_PIECE_BYTES = 1 << 18
_COMPRESSED = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ": "xz"}


@dataclass
class Cursor:
    """Position of the reader in the file: lines read so far, and whether this block is the last; ``sha256`` of a plain
    file after that."""

    lines: int = 0
    is_last: bool = False
    sha256: str = ""


def compression_of(magic: bytes) -> str | None:
    """Name of the compression, from a file's first bytes; None for an uncompressed file."""
    return next((name for start, name in _COMPRESSED.items() if magic.startswith(start)), None)


def open_binary(path: Path, compression: str | None) -> io.BufferedIOBase:
    """A stream of the decompressed bytes of a file."""
    if compression == "gzip":
        return gzip.open(path, "rb")
    if compression == "bzip2":
        return bz2.open(path, "rb")
    if compression == "xz":
        return lzma.open(path, "rb")
    return path.open("rb")


def blocks(
    path: Path, compression: str | None, cursor: Cursor, content: bytes | None = None
) -> Generator[bytes, None, None]:
    """Blocks that end with a complete line; ``content`` are the file's bytes if they are unpacked already.

    Raises
    ------
    ReadError
        When the file is damaged, or has no line ends.
    """
    rest, lines, unpacked = b"", 0, 0
    try:
        with open_binary(path, compression) if content is None else io.BytesIO(content) as stream:
            while True:
                pieces = [rest]
                size = 0
                # In pieces, so that the line at which a damaged archive breaks off is known.
                while size < BLOCK_BYTES and (piece := stream.read1(_PIECE_BYTES)):
                    pieces.append(piece)
                    size += len(piece)
                    unpacked += len(piece)
                    lines += piece.count(b"\n") if compression else 0
                if compression is not None:
                    check_ratio(path, path.stat().st_size, unpacked)
                data = b"".join(pieces)
                cursor.is_last = size < BLOCK_BYTES
                if cursor.is_last:
                    if data:
                        yield data
                    return
                cut = data.rfind(b"\n") + 1
                if cut == 0:
                    raise ReadError(f"{path}: no line end in {len(data) / 1e6:.0f} MB: this is not a text log.")
                rest = data[cut:]
                yield data[:cut]
    except (EOFError, zlib.error, lzma.LZMAError, gzip.BadGzipFile) as error:
        raise ReadError(
            f"{path}: the {compression} data is damaged or ends too early, after about {lines} lines "
            f"({error}); copy the file again or unpack what is left of it."
        ) from None
    except OSError as error:
        if compression is not None and error.errno is None:
            raise ReadError(f"{path}: the {compression} data is damaged ({error}); copy the file again.") from None
        raise from_os_error(path, error) from None


def beginning(path: Path, compression: str | None, n: int, content: bytes | None = None) -> bytes:
    """The first ``n`` bytes of the text.

    Raises
    ------
    ReadError
        As :func:`blocks`.
    """
    if content is not None:
        return content[:n]
    try:
        with open_binary(path, compression) as stream:
            return stream.read(n)
    except (EOFError, zlib.error, lzma.LZMAError, OSError):
        # Raises the error with the line after which the damage is.
        with closing(blocks(path, compression, Cursor())) as parts:
            return next(parts, b"")[:n]


_MINUS = "\u2212".encode()
"""The minus sign that typesetting programs and some spreadsheets write for ``-``."""
_SEMICOLON = re.compile(rb"(?m)^;")


def has_semicolon_remarks(data: bytes) -> bool:
    """Whether lines that begin with ``;`` are remarks: the first one does, and other lines contain no semicolon."""
    if not data.startswith(b";"):
        return False
    rows = [line for line in data[: 1 << 16].split(b"\n")[:-1] if line.strip() and not line.startswith(b";")]
    return bool(rows) and not any(b";" in line for line in rows)


def with_hash_remarks(data: bytes) -> bytes:
    """The text with remarks that begin with ``#`` instead of ``;``."""
    return _SEMICOLON.sub(b"#", data)


def as_utf8(path: Path, data: bytes, first_line: int) -> bytes:
    """Text with a byte order mark or in UTF-16 as plain UTF-8, with minus signs as ``-``; binary data, recognised by a
    zero byte, is refused."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace").encode().replace(_MINUS, b"-")
    data = data.removeprefix(b"\xef\xbb\xbf")
    # A search for one byte is ten times faster than one for three, and nearly all logs are ASCII.
    if _MINUS[:1] in data:
        data = data.replace(_MINUS, b"-")
    zero = data.find(b"\x00")
    if zero >= 0:
        line = first_line + data.count(b"\n", 0, zero)
        raise ReadError(
            f"{path}: line {line} holds binary data (a zero byte), so this is not a text log; "
            "convert it to CSV, or delete the damaged lines."
        )
    return data
