"""The bytes of a text log: decompressed, in blocks of complete lines, as plain UTF-8."""

import bz2
import gzip
import hashlib
import io
import lzma
import re
import zlib
from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trihedron.read.errors import ReadError, from_os_error
from trihedron.read.memory import check_ratio
from trihedron.records.progress import Progress

BLOCK_BYTES = 1 << 23
"""Bytes parsed at a time: enough for polars to use every core, and little memory (parsing takes about twelve times the
size of a block)."""

_PIECE_BYTES = 1 << 18
_COMPRESSED = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ": "xz"}
_OPENED_BY: dict[str | None, Any] = {"gzip": gzip.open, "bzip2": bz2.open, "xz": lzma.open, None: open}
Stream = io.BufferedReader | gzip.GzipFile | bz2.BZ2File | lzma.LZMAFile


@dataclass(frozen=True, eq=False)
class TextFile:
    """A text: ``size`` of the file [bytes], its ``compression``, or its ``content`` if it is unpacked (a member of a
    zip) or rewritten already, with the ``sha256`` of the file; ``progress`` of reading it."""

    path: Path
    size: int
    compression: str | None = None
    progress: Progress | None = None
    content: bytes | None = None
    sha256: str = ""


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


def open_binary(file: TextFile) -> Stream:
    """A stream of the decompressed bytes of a file."""
    if file.content is not None:
        return io.BufferedReader(io.BytesIO(file.content))
    opened: Stream = _OPENED_BY[file.compression](file.path, "rb")
    return opened


def blocks(file: TextFile, cursor: Cursor) -> Generator[bytes, None, None]:
    """Blocks that end with a complete line, each read while the previous one is parsed.

    Raises ``ReadError`` when the file cannot be read, is damaged, or has no line ends.
    """
    path, compression, is_plain = file.path, file.compression, file.compression is None and file.content is None
    digest, lines, unpacked = hashlib.sha256(), 0, 0
    try:
        with open_binary(file) as stream, ThreadPoolExecutor(1) as reader:

            def fill() -> tuple[bytes, bool]:
                nonlocal lines, unpacked
                parts, size = [], 0
                # In pieces, so that the line at which a damaged archive breaks off is known.
                while size < BLOCK_BYTES and (part := stream.read1(min(_PIECE_BYTES, BLOCK_BYTES - size))):
                    lines += part.count(b"\n") if compression else 0
                    size += len(part)
                    parts.append(part)
                block = b"".join([*parts, stream.readline(BLOCK_BYTES)])
                unpacked += len(block)
                if compression is not None:
                    check_ratio(path, path.stat().st_size, unpacked)
                elif is_plain:
                    digest.update(block)
                return block, not stream.peek(1)

            filling = reader.submit(fill)
            while not cursor.is_last:
                block, cursor.is_last = filling.result()
                if cursor.is_last:
                    cursor.sha256 = digest.hexdigest() if is_plain else ""
                elif block.endswith(b"\n"):
                    filling = reader.submit(fill)
                else:
                    raise ReadError(f"{path}: no line end in {len(block) / 1e6:.0f} MB: this is not a text log.")
                if block:
                    yield block
    except (EOFError, zlib.error, lzma.LZMAError, gzip.BadGzipFile) as error:
        raise ReadError(
            f"{path}: the {compression} data is damaged or ends too early, after about {lines} lines "
            f"({error}); copy the file again or unpack its undamaged part."
        ) from None
    except OSError as error:
        if compression is not None and error.errno is None:
            raise ReadError(f"{path}: the {compression} data is damaged ({error}); copy the file again.") from None
        raise from_os_error(path, error) from None


def beginning(file: TextFile, n: int) -> bytes:
    """The first ``n`` bytes of the text.

    Raises ``ReadError`` as :func:`blocks`.
    """
    try:
        with open_binary(file) as stream:
            return stream.read(n)
    except (EOFError, zlib.error, lzma.LZMAError, OSError):
        # Raises the error with the line after which the damage is.
        with closing(blocks(file, Cursor())) as parts:
            return next(parts, b"")[:n]


_MINUS = "\u2212".encode()
"""The minus sign that typesetting programs and some spreadsheets write for ``-``."""
SEMICOLON_REMARK = re.compile(rb"(?m)^;")


def has_semicolon_remarks(data: bytes) -> bool:
    """Whether lines that begin with ``;`` are remarks: the first one does, and other lines contain no semicolon."""
    if not data.startswith(b";"):
        return False
    rows = [line for line in data[: 1 << 16].split(b"\n")[:-1] if line.strip() and not line.startswith(b";")]
    return bool(rows) and not any(b";" in line for line in rows)


def as_utf8(path: Path, data: bytes, first_line: int) -> bytes:
    """Text with a byte order mark or in UTF-16 as plain UTF-8, with minus signs as ``-``; binary data, recognised by a
    zero byte, is rejected."""
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
            f"{path}: line {line} contains binary data (a zero byte), so this is not a text log; "
            "convert it to CSV, or delete the damaged lines."
        )
    return data
