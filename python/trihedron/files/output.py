"""Output files: written completely or not at all, over an existing file only on request, and never over an input.

A regular file is written under a temporary name in the same folder and renamed in one step. Other outputs (a device, a
pipe) are written to directly and never replaced.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from trihedron.errors import InputError

if sys.platform != "win32":
    import fcntl

MARK = ".trihedron-"
_MOST_BYTES_OF_NAME = 180
"""Bytes of the output's name used in the temporary name; a file name may have 255 bytes."""

_UNDER_WAY: set[str] = set()


class Temporary:
    """A temporary file beside ``target``, locked while its process lives, and deleted unless put in place."""

    def __init__(self, target: Path) -> None:
        self.target = target
        start = os.fsencode(target.name)[:_MOST_BYTES_OF_NAME].decode(errors="replace").replace("\ufffd", "_")
        while True:
            name = f".{start}{MARK}{os.getpid()}-{os.urandom(4).hex()}"
            self.path = str(target.parent / name)
            _UNDER_WAY.add(self.path)
            self.descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _CLOEXEC, 0o600)
            _lock(self.descriptor)
            # Before the lock another process may have deleted it as a leftover.
            with suppress(OSError):
                if os.path.samestat(os.stat(self.path), os.fstat(self.descriptor)):
                    return
            os.close(self.descriptor)

    def __enter__(self) -> Temporary:
        return self

    def write(self, data: bytes) -> None:
        """Write all of ``data`` and sync it to the disk."""
        left = memoryview(data)
        while left:
            left = left[os.write(self.descriptor, left) :]
        os.fsync(self.descriptor)

    def put_in_place(self, mode: int | None, *, overwrite: bool = False) -> None:
        """Rename to the target, which replaces a file of permissions ``mode``, or is new where ``mode`` is None.

        Raises FileExistsError when ``mode`` is None and a file has appeared, without ``overwrite``.
        """
        # The file was created private; it gets the permissions of the file it replaces, or those of any new file.
        if mode is None:
            mask = os.umask(0)
            os.umask(mask)
        os.chmod(self.path, mode if mode is not None else 0o666 & ~mask)
        if mode is not None or overwrite:
            os.replace(self.path, self.target)
            return
        try:
            # A link fails where a file has appeared meanwhile; a rename would replace it.
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
    """Delete this process's unfinished temporary files, before it terminates early."""
    for path in list(_UNDER_WAY):
        with suppress(OSError):
            os.unlink(path)


def clear_leftovers(folder: Path) -> None:
    """Delete temporary files of killed processes: those that no process has locked."""
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
    """Lock the file; whether that succeeded. Where files cannot be locked, leftovers are never deleted."""
    if sys.platform == "win32":
        return wait
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


class OutputError(InputError):
    """A file that cannot be written. One sentence: which file, why, what to do."""


def check_report(path: Path) -> None:
    """Reject a report whose ending is not that of a format.

    Raises ``InputError`` when the ending is unknown; the message lists the valid ones.
    """
    if path.suffix.lower() not in (".html", ".txt", ".json"):
        raise OutputError(f"{path}: the file's ending selects the format of a report; give .html, .txt or .json.")


def check_free(
    paths: Iterable[Path | None], *, overwrite: bool, inputs: Iterable[str | os.PathLike[str] | None] = ()
) -> None:
    """Reject outputs that cannot be written, before the work is done.

    ``inputs`` are the files that the outputs are made from: none of them is overwritten, even with ``overwrite``.

    Raises ``InputError`` when a file exists and may not be replaced, is an input or read-only, its folder is missing
    or not writable, or one name is given twice.
    """
    read = {identity: Path(path) for path in inputs if path is not None and (identity := _identity(path))}
    seen: set[str] = set()
    for path in paths:
        if path is None or str(path) == "-":
            continue
        found = _status(path)
        if is_stream(path, found):
            if found is not None and stat.S_ISBLK(found.st_mode) and not overwrite:
                raise OutputError(f"{path}: this is a disk, all of which would be lost; add --force to write on it.")
            continue
        place = os.path.realpath(path)
        if place in seen:
            raise OutputError(f"{path}: two outputs were given this one name; give each its own.")
        seen.add(place)
        if found is not None:
            if (source := read.get((found.st_dev, found.st_ino))) is not None:
                raise OutputError(f"{path}: this is the input {source.name} itself; give the output another name.")
            _check_replaceable(path, found, overwrite=overwrite)
        _check_folder(path, os.path.dirname(place))


def _identity(path: str | os.PathLike[str]) -> tuple[int, int] | None:
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None
    # Reading from a terminal or a pipe and writing to it is harmless.
    return (found.st_dev, found.st_ino) if stat.S_ISREG(found.st_mode) else None


def _status(path: Path) -> os.stat_result | None:
    """Status of the file at a path, links followed; None where there is none."""
    try:
        return os.stat(path)
    except FileNotFoundError:
        return None
    except NotADirectoryError:
        raise OutputError(f"{path}: a part of this name is a file and not a folder; choose another name.") from None
    except (OSError, ValueError) as error:
        # A loop of links, a name that is too long, a folder without permission.
        why = getattr(error, "strerror", None) or error
        raise OutputError(f"{str(path)!r}: this cannot be the name of an output ({why}); choose another.") from None


def _check_replaceable(path: Path, found: os.stat_result, *, overwrite: bool) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise OutputError(f"{path}: this is a directory; name a file inside it.")
    if not overwrite:
        raise OutputError(f"{path}: the file exists and was left alone; choose another name or add --force.")
    # The mode is checked too: the superuser can write to everything, but a read-only file is protected on purpose.
    if not found.st_mode & 0o222 or not os.access(path, os.W_OK):
        raise OutputError(f"{path}: the file is read-only and was left alone; choose another name or `chmod u+w` it.")


def _check_folder(path: Path, folder: str) -> None:
    if not os.path.isdir(folder):
        raise OutputError(f"{path}: there is no folder {folder}; make it first.")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"{path}: no permission to write into {folder}; choose another folder.")


def write_whole(path: str | os.PathLike[str], content: str | bytes, *, overwrite: bool = False) -> None:
    """Write a file in one step: a reader sees the old or the new content, never a part of it.

    A link is followed. Temporary files of killed processes in the folder are deleted.

    Raises ``InputError`` as :func:`check_free`, or when the system rejects.
    """
    target = Path(path)
    check_free([target], overwrite=overwrite)
    data = content.encode(errors="backslashreplace") if isinstance(content, str) else content
    found = _status(target)
    try:
        if is_stream(target, found):
            write_stream(target, found, data)
            return
        place = Path(os.path.realpath(target))
        clear_leftovers(place.parent)
        with Temporary(place) as temporary:
            temporary.write(data)
            temporary.put_in_place(None if found is None else stat.S_IMODE(found.st_mode), overwrite=overwrite)
    except FileExistsError:
        raise OutputError(f"{target}: the file appeared meanwhile and was left alone; choose another name.") from None
    except OSError as error:
        raise OutputError(f"{target}: the system cannot write this file ({error.strerror or error}).") from None


# Outputs that are not regular files: terminals, pipes, devices. They are written to directly.

_READER_WAIT_S = 5.0
"""Time to wait for the reader of a pipe [s]: enough for two commands started together, but not forever."""

_OPEN_FILES = ("/dev/fd/", "/proc/self/fd/", "/dev/stdout", "/dev/stderr", "/dev/stdin")


def is_stream(path: Path, found: os.stat_result | None) -> bool:
    """Whether an output is written to directly: it exists and is neither a regular file nor a directory.

    This includes names of files that this process has open (``/dev/stdout``), whatever they refer to.
    """
    if str(path).startswith(_OPEN_FILES):
        return True
    return found is not None and not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode))


def write_stream(path: Path, found: os.stat_result | None, data: bytes) -> None:
    """Write all of ``data`` to a device or pipe.

    Raises OSError when a pipe has no reader, or the system rejects.
    """
    with os.fdopen(_opened(path, found), "wb", buffering=0) as stream:
        left = memoryview(data)
        while left:
            left = left[stream.write(left) or 0 :]


def _opened(path: Path, found: os.stat_result | None) -> int:
    """A descriptor for writing, in append mode except for pipes, since the shell may have opened the file."""
    if found is None or not stat.S_ISFIFO(found.st_mode):
        return os.open(path, os.O_WRONLY | os.O_APPEND | os.O_NOCTTY)
    waited = time.monotonic() + _READER_WAIT_S
    while True:
        try:
            descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
            break
        except OSError as error:
            if error.errno != errno.ENXIO:
                raise
            if time.monotonic() > waited:
                raise OSError(errno.ENXIO, "nobody reads from this pipe") from None
            time.sleep(0.05)
    os.set_blocking(descriptor, True)
    return descriptor
