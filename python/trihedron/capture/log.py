"""The log of a capture: text that grows row by row and is complete and readable after every write."""

import errno
import os
import time
from contextlib import suppress
from pathlib import Path

from trihedron.capture.errors import CaptureError, DiskError

FLUSH_S = 0.1
"""Seconds between writes: the most that a killed process loses, besides waiting pieces (docs/capture.md, section 4)."""

SYNC_S = 5.0
"""Seconds between syncs of the file to the disk, which limit the loss in a power failure."""

_LINE = 240
"""Length in bytes of the header lines that are rewritten while the log grows."""

FORMAT = "trihedron capture 1"


class GrowingLog:
    """Appends rows; only two header lines of fixed length are rewritten.

    Raises ``CaptureError`` when the file exists and ``overwrite`` is not set, or its folder cannot be written to.
    """

    def __init__(self, path: Path, *, overwrite: bool = False) -> None:
        self.path = path
        flags = os.O_WRONLY | os.O_CREAT | (os.O_TRUNC if overwrite else os.O_EXCL)
        try:
            self._handle = os.open(path, flags, 0o666)
        except FileExistsError:
            raise CaptureError(
                f"{path}: the file exists and was left alone; choose another name or add --force."
            ) from None
        except OSError as error:
            raise CaptureError(f"{path}: the log cannot be written there ({error.strerror}).") from None
        self._waiting: list[str] = []
        self._size = 0
        self._places: dict[str, int] = {}
        self._flushed_s = self._synced_s = time.monotonic()
        self.rows_saved = 0
        self._rows_waiting = 0

    def begin(self, facts: dict[str, str], columns: list[str]) -> None:
        """Write the header: constant facts, two lines to be filled later, and the column names."""
        text = f"# {FORMAT}\n" + "".join(f"# {key}: {_plain(value)}\n" for key, value in facts.items())
        for key in ("frames", "clock"):
            self._places[key] = len(text.encode())
            text += f"# {key}: not known yet".ljust(_LINE - 1) + "\n"
        self._write(text + ",".join(columns) + "\n")

    def fill(self, key: str, value: str) -> None:
        """Rewrite one of the two header lines."""
        if key not in self._places:
            return
        line = f"# {key}: {_plain(value)}".encode("ascii", "replace")[: _LINE - 1].ljust(_LINE - 1) + b"\n"
        try:
            os.pwrite(self._handle, line, self._places[key])
        except OSError as error:
            raise self._rejected(error) from None

    def row(self, text: str) -> None:
        """Add one row, given without its end of line."""
        self._waiting.append(text)
        self._rows_waiting += 1

    def remark(self, text: str) -> None:
        """Add a comment line, which readers skip."""
        self._waiting.append(f"# {_plain(text)}")

    def flush(self, *, force: bool = False) -> None:
        """Write pending rows if ``FLUSH_S`` has passed or ``force`` is set.

        Raises ``DiskError`` when the disk is full or cannot be written; rows written before are intact.
        """
        now = time.monotonic()
        if not (force or now - self._flushed_s >= FLUSH_S):
            return
        if self._waiting:
            self._write("\n".join(self._waiting) + "\n")
            self.rows_saved += self._rows_waiting
            self._waiting.clear()
            self._rows_waiting = 0
        # Counted from the end of the write: a slow disk gets fewer and larger pieces.
        self._flushed_s = time.monotonic()
        if now - self._synced_s >= SYNC_S:
            self._synced_s = now
            try:
                os.fdatasync(self._handle)
            except OSError as error:
                raise self._rejected(error) from None

    def close(self) -> None:
        """Write pending rows and close the file."""
        try:
            if self._handle >= 0:
                self.flush(force=True)
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close the file without writing pending rows."""
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1

    def _write(self, text: str) -> None:
        data = memoryview(text.encode())
        start = self._size
        while data:
            try:
                n = os.write(self._handle, data)
            except InterruptedError:
                continue
            except OSError as error:
                self._cut(start, bytes(text.encode())[: self._size - start])
                raise self._rejected(error) from None
            self._size += n
            data = data[n:]

    def _cut(self, start: int, written: bytes) -> None:
        """Truncate an incomplete row at the end; count the complete rows of the piece as saved."""
        whole = written.rfind(b"\n") + 1
        kept = written[:whole]
        self.rows_saved += sum(1 for line in kept.split(b"\n") if line and not line.startswith(b"#"))
        self._size = start + whole
        # If this fails too, the reader reports an incomplete last line.
        with suppress(OSError):
            os.ftruncate(self._handle, self._size)

    def _rejected(self, error: OSError) -> DiskError:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
        why = "the disk is full" if full else f"the disk cannot be written ({error.strerror})"
        remedy = "free some space and capture anew" if full else "check the disk"
        return DiskError(
            f"{self.path}: {why}; {self.rows_saved} rows are saved and readable, nothing after them: {remedy}.",
            self.rows_saved,
        )


def _plain(text: str) -> str:
    """The text without commas, semicolons or line ends: a header line must not look like column names."""
    return " ".join(text.replace(",", " ").replace(";", " ").split())
