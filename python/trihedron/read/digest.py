"""SHA-256 of a file that is read: computed at once, or on a thread while the readings are processed."""

from __future__ import annotations

import hashlib
import weakref
from collections.abc import Generator
from concurrent.futures import Future
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from threading import Thread

from trihedron.read.errors import ReadError, from_os_error

_CHUNK = 1 << 20
"""Bytes read at a time; they stay in the processor's cache until they are digested."""


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


@contextmanager
def kept_open(path: Path) -> Generator[FileIO, None, None]:
    """The opened file; closed if reading it fails, otherwise closed by :class:`LateSha256`."""
    try:
        stream = path.open("rb", buffering=0)
    except OSError as error:
        raise from_os_error(path, error) from None
    try:
        yield stream
    except BaseException:
        stream.close()
        raise


class LateSha256:
    """SHA-256 of a file's first ``n_bytes``, computed on a separate thread, which closes ``stream``, the opened file.

    Parsing uses every core and the audit of the readings does not, so the digest runs during the audit instead of
    delaying the parsing. Bytes appended meanwhile are excluded from it, as from the readings. The thread ends with this
    object, so nothing waits for the digest of a file that is not a log.
    """

    def __init__(self, path: Path, stream: FileIO, n_bytes: int) -> None:
        self._path = path
        self._future: Future[str | None] = Future()
        wanted = weakref.ref(self)
        Thread(target=_digest, args=(stream, n_bytes, self._future, wanted), name="digest", daemon=True).start()

    def hexdigest(self) -> str:
        """The digest, hexadecimal; waits until it is computed.

        Raises
        ------
        ReadError
            When the file cannot be read again, or was truncated.
        """
        try:
            digest = self._future.result()
        except OSError as error:
            raise from_os_error(self._path, error) from None
        if digest is None:
            raise ReadError(f"{self._path}: the file became shorter while it was read; wait until it is written.")
        return digest


def _digest(stream: FileIO, n_bytes: int, future: Future[str | None], wanted: weakref.ref[LateSha256]) -> None:
    digest, room = hashlib.sha256(), memoryview(bytearray(_CHUNK))
    try:
        with stream:
            stream.seek(0)
            while n_bytes and wanted() is not None:
                count = stream.readinto(room[: min(n_bytes, _CHUNK)])
                if not count:
                    break
                digest.update(room[:count])
                n_bytes -= count
        future.set_result(None if n_bytes else digest.hexdigest())
    except BaseException as error:
        future.set_exception(error)


def hexdigest(*sha256: str | LateSha256) -> str:
    """The digest of a file, hexadecimal, waited for if necessary; for several files, the digest of their digests."""
    known = [one if isinstance(one, str) else one.hexdigest() for one in sha256]
    return known[0] if len(known) == 1 else hashlib.sha256("".join(known).encode()).hexdigest()
