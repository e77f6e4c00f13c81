"""The log of a capture: text that grows row by row and is complete and readable after every write."""

import errno
import os
import time
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path

from trihedron.arrivals import ClockLine
from trihedron.capture.errors import CaptureError, DiskError
from trihedron.capture.sequence import Placed
from trihedron.capture.sources import Source
from trihedron.capture.timeline import Count, Timeline, clock_sentence
from trihedron.protocols.framing import Decoder

FLUSH_S = 0.1
"""Seconds between writes: the most that a killed process loses, besides waiting pieces (docs/capture.md, section 4)."""

SYNC_S = 5.0
"""Seconds between syncs of the file to the disk, which limit the loss in a power failure."""

_LINE = 240
"""Length in bytes of the header lines that are rewritten while the log grows."""

FORMAT = "trihedron capture 1"


class GrowingLog:
    """Rows with times, indices and remarks; only two header lines of fixed length are rewritten.

    ``rate_hz`` is that of a device without a clock, if known. Raises ``CaptureError`` when the file exists and
    ``overwrite`` is not set, or its folder cannot be written to.
    """

    def __init__(self, path: Path, source: Source, rate_hz: float | None, *, overwrite: bool = False) -> None:
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
        self._source, self._rate_hz = source, rate_hz
        self._started = datetime.now(timezone.utc)
        self._has_time = self._has_device_clock = False
        self._offset = self._next_index = 0
        self._remarks: list[str] = []

    @property
    def is_begun(self) -> bool:
        """Whether the header is written."""
        return bool(self._places)

    def index(self, one: Placed) -> int:
        """The frame's index in the log; it continues that of the previous connection."""
        return one.place + self._offset

    def begin(self, decoder: Decoder, timeline: Timeline) -> None:
        """Write the header, once: constant facts, two lines to be filled later, and the column names.

        The first frame has shown which columns and clocks there are.
        """
        if self.is_begun:
            return
        self._has_device_clock = timeline.has_device_clock
        self._has_time = timeline.has_device_clock or self._source.is_live or self._rate_hz is not None
        names = ["time [s]"] if self._has_time else []
        names += ["host_s"] if self._source.is_live else []
        names += ["frame", *(["device_ticks"] if self._has_device_clock else [])]
        facts = {
            "protocol": decoder.name,
            "source": self._source.name,
            "started": self._started.isoformat(timespec="milliseconds"),
            "device clock": f"{timeline.tick_s:g} s per tick" if self._has_device_clock else "none",
        }
        text = f"# {FORMAT}\n" + "".join(f"# {key}: {_plain(value)}\n" for key, value in facts.items())
        for key in ("frames", "clock"):
            self._places[key] = len(text.encode())
            text += f"# {key}: not known yet".ljust(_LINE - 1) + "\n"
        self._write(text + ",".join([*names, *decoder.columns]) + "\n")

    def add(self, one: Placed, timeline: Timeline, *, is_first: bool, lost_while_away: int = 0) -> float:
        """Write one row, and remarks on losses or a restart before it; return its time [s]."""
        if is_first and self._next_index:
            self._offset = self._next_index + lost_while_away - one.place
        index = self.index(one)
        time_s = timeline.place(index, one.frame.ticks, one.host_s, restarted=one.restarted or is_first)
        lost = one.lost + lost_while_away
        if lost:
            least = "at least " if one.is_wrapped else ""
            self.say(f"lost {least}{lost} before frame {index} at {time_s:.6f} s")
        if one.restarted:
            self.say(f"the device began to count anew before frame {index} at {time_s:.6f} s")
        self._next_index = index + 1
        parts = [f"{time_s:.6f}"] if self._has_time else []
        if self._source.is_live:
            parts.append(f"{one.host_s:.6f}")
        parts.append(str(index))
        if self._has_device_clock:
            parts.append(str(one.frame.ticks))
        self._waiting.append(",".join(parts) + "," + one.frame.text)
        self._rows_waiting += 1
        return time_s

    def say(self, text: str) -> None:
        """Add a remark to the next block, and to the log, as a comment line, if it has begun."""
        self._remarks.append(text)
        if self.is_begun:
            self._waiting.append(f"# {_plain(text)}")

    def take_remarks(self) -> tuple[str, ...]:
        """The remarks since the last call."""
        remarks, self._remarks = tuple(self._remarks), []
        return remarks

    def say_facts(self, count: Count, clock: ClockLine | None, timeline: Timeline | None) -> None:
        """Rewrite the header lines on frames and clocks."""
        facts = {"frames": count.sentence(), "clock": clock_sentence(clock, timeline)}
        for key, place in self._places.items():
            line = f"# {key}: {_plain(facts[key])}".encode("ascii", "replace")[: _LINE - 1].ljust(_LINE - 1) + b"\n"
            try:
                os.pwrite(self._handle, line, place)
            except OSError as error:
                raise self._rejected(error) from None

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
        """Write pending rows and close the log; delete a log without any row."""
        try:
            if self._handle >= 0:
                self.flush(force=True)
        finally:
            self.abandon()
        if not self.is_begun:
            self.path.unlink(missing_ok=True)

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
