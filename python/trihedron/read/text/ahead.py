"""The bytes of an uncompressed text log in blocks of complete lines, each read while the previous one is parsed."""

from __future__ import annotations

import hashlib
from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import numpy.typing as npt

from trihedron.read.errors import ReadError, from_os_error
from trihedron.read.text import blocks
from trihedron.read.text.blocks import Cursor

Bytes = npt.NDArray[np.uint8]

_ROOM = 1 << 16
"""Bytes before a block for the incomplete last line of the previous one; a longer line is copied."""
_TAIL = 1 << 12
"""Bytes at the end of a block that nearly always contain a line end."""


def blocks_ahead(path: Path, cursor: Cursor) -> Generator[Bytes, None, None]:
    """Blocks (k,) of a file that end with a complete line; each is valid until the next one is requested.

    Raises
    ------
    ReadError
        When the file cannot be read, or has no line ends.
    """
    most, digest = blocks.BLOCK_BYTES, hashlib.sha256()
    try:
        with path.open("rb", buffering=0) as stream, ThreadPoolExecutor(1) as reader:

            def fill(buffer: Bytes) -> int:
                view, size = buffer.data[_ROOM:], 0
                while size < most and (count := stream.readinto(view[size:])):
                    size += count
                digest.update(view[:size])
                return size

            buffers = [np.empty(_ROOM + most, dtype=np.uint8) for _ in range(2)]
            filling = reader.submit(fill, buffers[0])
            rest = np.empty(0, dtype=np.uint8)
            while True:
                size, buffer = filling.result(), buffers[0]
                block = _joined(rest, buffer, size)
                cursor.is_last = size < most
                if cursor.is_last:
                    cursor.sha256 = digest.hexdigest()
                    if len(block):
                        yield block
                    return
                cut = _behind_last_line(block)
                if cut == 0:
                    raise ReadError(f"{path}: no line end in {len(block) / 1e6:.0f} MB: this is not a text log.")
                rest = block[cut:].copy()
                buffers.reverse()
                filling = reader.submit(fill, buffers[0])
                yield block[:cut]
    except OSError as error:
        raise from_os_error(path, error) from None


def _joined(rest: Bytes, buffer: Bytes, size: int) -> Bytes:
    if len(rest) > _ROOM:
        return np.concatenate([rest, buffer[_ROOM : _ROOM + size]])
    start = _ROOM - len(rest)
    buffer[start:_ROOM] = rest
    return buffer[start : _ROOM + size]


def _behind_last_line(block: Bytes) -> int:
    """Index after the last line end; 0 where there is none."""
    near = max(len(block) - _TAIL, 0)
    found = block[near:].tobytes().rfind(b"\n")
    return near + found + 1 if found >= 0 else block.tobytes().rfind(b"\n") + 1
