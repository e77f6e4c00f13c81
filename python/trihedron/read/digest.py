"""SHA-256 of a file that is read."""

from __future__ import annotations

import hashlib
from pathlib import Path

from trihedron.read.errors import from_os_error


def file_sha256(path: Path) -> str:
    """SHA-256 of the bytes of a file, hexadecimal."""
    digest = hashlib.sha256()
    try:
        with path.open("rb") as stream:
            while block := stream.read(1 << 22):
                digest.update(block)
    except OSError as error:
        raise from_os_error(path, error) from None
    return digest.hexdigest()
