"""Outputs that are no plain files: terminals, pipes, sockets, devices. They are written to where they are."""

from __future__ import annotations

import errno
import os
import socket
import stat
import time
from pathlib import Path

_READER_WAIT_S = 5.0
"""How long a pipe waits for its reader: two commands started together meet; one alone must not wait for ever."""

_OPEN_FILES = ("/dev/fd/", "/proc/self/fd/", "/dev/stdout", "/dev/stderr", "/dev/stdin")


def is_stream(path: Path, found: os.stat_result | None) -> bool:
    """Whether an output is written to as it stands: whatever exists and is neither a plain file nor a directory.

    A name for a file that this process has open already (``/dev/stdout``) is one too, wherever it leads.
    """
    if str(path).startswith(_OPEN_FILES):
        return True
    return found is not None and not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode))


def write_stream(path: Path, found: os.stat_result | None, data: bytes) -> None:
    """All of ``data`` to a device, pipe or socket.

    Raises
    ------
    OSError
        When nobody reads a pipe, or the system refuses.
    """
    if found is not None and stat.S_ISSOCK(found.st_mode):
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(path))
            connection.sendall(data)
        return
    with os.fdopen(_opened(path, found), "wb", buffering=0) as stream:
        left = memoryview(data)
        while left:
            left = left[stream.write(left) or 0 :]


def _opened(path: Path, found: os.stat_result | None) -> int:
    """A descriptor to write to; appending, where it is a file that a shell has opened already."""
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
