"""Files on their way: written beside their place, moved there in one step, and cleared away when a run was killed."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path
from types import TracebackType

if sys.platform != "win32":
    import fcntl

MARK = ".trihedron-"
_MOST_BYTES_OF_NAME = 180
"""Of the output's own name in the temporary one: a name may have 255 bytes."""

_UNDER_WAY: set[str] = set()


class Temporary:
    """A file beside ``target`` that is locked as long as its writer lives; gone at the end unless put in place."""

    def __init__(self, target: Path) -> None:
        self.target = target
        start = os.fsencode(target.name)[:_MOST_BYTES_OF_NAME].decode(errors="replace").replace("\ufffd", "_")
        while True:
            name = f".{start}{MARK}{os.getpid()}-{os.urandom(4).hex()}"
            self.path = str(target.parent / name)
            _UNDER_WAY.add(self.path)
            self.descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _CLOEXEC, 0o600)
            _lock(self.descriptor)
            # Another run may have taken it for a leftover in the moment before the lock.
            with suppress(OSError):
                if os.path.samestat(os.stat(self.path), os.fstat(self.descriptor)):
                    return
            os.close(self.descriptor)

    def __enter__(self) -> Temporary:
        return self

    def write(self, data: bytes) -> None:
        """All of ``data``, on the disk when this returns."""
        left = memoryview(data)
        while left:
            left = left[os.write(self.descriptor, left) :]
        os.fsync(self.descriptor)

    def put_in_place(self, mode: int | None, *, overwrite: bool = False) -> None:
        """Become the target: in the place of an old file of ``mode``, or, where it is None, of nothing.

        Raises
        ------
        FileExistsError
            When there was nothing and now there is something that ``overwrite`` does not cover.
        """
        # Made private above; a result is as readable as the one it replaces, or as any file the user makes.
        if mode is None:
            mask = os.umask(0)
            os.umask(mask)
        os.chmod(self.path, mode if mode is not None else 0o666 & ~mask)
        if mode is not None or overwrite:
            os.replace(self.path, self.target)
            return
        try:
            # A link fails where a file appeared in the meantime; a rename would replace it.
            os.link(self.path, self.target)
        except FileExistsError:
            raise
        except OSError:
            # File systems without links (FAT, some shares).
            if self.target.exists():
                raise FileExistsError from None
            os.replace(self.path, self.target)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(OSError):
            os.unlink(self.path)
        os.close(self.descriptor)
        _UNDER_WAY.discard(self.path)


def remove_unfinished() -> None:
    """Take away the files that this process has under way: it is about to end in the middle."""
    for path in list(_UNDER_WAY):
        with suppress(OSError):
            os.unlink(path)


def clear_leftovers(folder: Path) -> None:
    """Remove the unfinished files of runs that were killed: those that nobody holds locked any more."""
    with suppress(OSError):
        with os.scandir(folder) as entries:
            names = [entry.path for entry in entries if entry.name.startswith(".") and MARK in entry.name]
        for path in names:
            with suppress(OSError):
                _remove_unless_held(path)


def _remove_unless_held(path: str) -> None:
    descriptor = os.open(path, os.O_WRONLY | _NOFOLLOW | _CLOEXEC)
    try:
        if _lock(descriptor, wait=False):
            os.unlink(path)
    finally:
        os.close(descriptor)


_CLOEXEC = getattr(os, "O_CLOEXEC", 0)
_NOFOLLOW = getattr(os, "O_NOFOLLOW", 0)


def _lock(descriptor: int, *, wait: bool = True) -> bool:
    """Whether the lock was had; where files cannot be locked, none is, and nothing is cleared away."""
    if sys.platform == "win32":
        return wait
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
