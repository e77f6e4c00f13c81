"""Errors of files that cannot be read, each one sentence; checks of a file before reading, and its hash."""

import hashlib
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from trihedron.errors import InputError
from trihedron.subprocesses import check_tables


@contextmanager
def stderr_without(noise: bytes) -> Iterator[None]:
    """Redirect file descriptor 2 to a file; afterwards print its content unless it contains ``noise``.

    Libraries write to it directly: a panic of polars becomes an exception, but its hook prints a backtrace first.
    Nothing is redirected where standard error is closed or is not a file.
    """
    try:
        sys.stderr.flush()
        before = os.dup(2)
    except (OSError, ValueError, AttributeError):
        yield
        return
    with tempfile.TemporaryFile() as kept:
        os.dup2(kept.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(before, 2)
            os.close(before)
            kept.seek(0)
            said = kept.read()
            if noise not in said:
                os.write(2, said)


class ReadError(InputError):
    """A file that cannot become a recording. The message is one sentence: which file, which line, what to do."""


@contextmanager
def errors_of_system(path: Path) -> Iterator[None]:
    """Convert errors of the operating system to a :class:`ReadError` with advice."""
    try:
        yield
    except OSError as error:
        raise from_os_error(path, error) from None


@contextmanager
def errors_of_library(path: Path, damage: str, kinds: tuple[type[Exception], ...] = (Exception,)) -> Iterator[None]:
    """Convert errors of a library to a :class:`ReadError` that states ``damage``, with ``{}`` for the error's words.

    For damaged files libraries raise errors of every layer below them, hence all kinds unless some are named.
    """
    try:
        yield
    except ReadError:
        raise
    except kinds as error:
        raise ReadError(f"{path}: {damage.format(first_line(error))}.") from None


@contextmanager
def errors_of_polars(path: Path, damage: str, remedy: str = "") -> Iterator[None]:
    """Convert errors and panics of polars, and of the system, to a :class:`ReadError` that states ``damage``."""
    import polars

    try:
        with errors_of_system(path), stderr_without(b"panicked at"):
            yield
    except polars.exceptions.PanicException:
        raise ReadError(f"{path}: {damage}{remedy}.") from None
    except polars.exceptions.PolarsError as error:
        raise ReadError(f"{path}: {damage} ({first_line(error)}){remedy}.") from None


def first_line(error: BaseException) -> str:
    """The first line of a library's error message, at most 160 characters."""
    return (str(error).strip().split("\n")[0] or type(error).__name__)[:160]


def from_os_error(path: Path, error: OSError) -> ReadError:
    """The operating system's error as a :class:`ReadError` with advice."""
    if isinstance(error, FileNotFoundError):
        return ReadError(f"{path}: there is no such file; check the name and the folder.")
    if isinstance(error, IsADirectoryError):
        return ReadError(f"{path}: this is a directory; name the log inside it, or --accel FILE --gyro FILE of two.")
    if isinstance(error, PermissionError):
        return ReadError(f"{path}: no permission to read this file; change its permissions or copy it.")
    return ReadError(f"{path}: the system cannot read this file ({error.strerror or error}); copy it to a local disk.")


def reject_after_fork(path: Path) -> None:
    """Error in a child process made by fork, where polars would wait forever.

    Raises ``ReadError``: Where the library that parses tables cannot be used.
    """
    try:
        check_tables()
    except ValueError as error:
        raise ReadError(f"{path}: {error}") from None


def check_readable(path: Path) -> int:
    """Size in bytes of a readable regular file.

    Raises ``ReadError`` when it is missing, a directory, not a regular file, empty, or may not be read.
    """
    with errors_of_system(path):
        try:
            status = path.stat()
        except ValueError:
            raise ReadError(
                f"{str(path)!r}: this is not a possible file name; check it for stray characters."
            ) from None
        if path.is_dir():
            raise IsADirectoryError
        if not path.is_file():
            raise ReadError(f"{path}: this is not a plain file; save the stream to a file first.")
        if not os.access(path, os.R_OK):
            raise PermissionError
    if status.st_size == 0:
        raise ReadError(f"{path}: the file is empty; record again or copy it again.")
    return status.st_size


def file_sha256(path: Path) -> str:
    """SHA-256 of the bytes of a file, hexadecimal."""
    digest = hashlib.sha256()
    with errors_of_system(path), path.open("rb") as stream:
        while block := stream.read(1 << 22):
            digest.update(block)
    return digest.hexdigest()


def first_bytes(path: Path, n: int) -> bytes:
    """The first ``n`` bytes of a file."""
    with errors_of_system(path), path.open("rb") as stream:
        return stream.read(n)
