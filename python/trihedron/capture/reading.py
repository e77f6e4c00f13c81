"""Rows of a log, and the thread that only reads the source and never waits for a disk or a decoder."""

import queue
import threading
import time
from collections.abc import Callable
from datetime import datetime, timezone
from pathlib import Path

from trihedron.arrivals import ClockLine
from trihedron.capture.errors import CaptureError, SourceEndedError, SourceLostError
from trihedron.capture.log import GrowingLog
from trihedron.capture.sequence import Placed
from trihedron.capture.sources import Source
from trihedron.capture.timeline import Count, Timeline, clock_sentence
from trihedron.protocols.framing import Decoder


class Rows(GrowingLog):
    """The log with times, indices and remarks; ``rate_hz`` is that of a device without a clock, if known."""

    def __init__(self, path: Path, source: Source, rate_hz: float | None, *, overwrite: bool) -> None:
        super().__init__(path, overwrite=overwrite)
        self.is_begun = False
        self._source, self._rate_hz = source, rate_hz
        self._started = datetime.now(timezone.utc)
        self._has_time = self._has_device_clock = False
        self._offset = self._next_index = 0
        self._remarks: list[str] = []

    def index(self, one: Placed) -> int:
        """The frame's index in the log; it continues that of the previous connection."""
        return one.place + self._offset

    def begin_with(self, decoder: Decoder, timeline: Timeline) -> None:
        """Write the header, once; the first frame has shown which columns and clocks there are."""
        if self.is_begun:
            return
        self.is_begun = True
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
        self.begin(facts, [*names, *decoder.columns])

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
        self.row(",".join(parts) + "," + one.frame.text)
        return time_s

    def say(self, text: str) -> None:
        """Add a remark to the next block, and to the log if it has begun."""
        self._remarks.append(text)
        if self.is_begun:
            self.remark(text)

    def take_remarks(self) -> tuple[str, ...]:
        """The remarks since the last call."""
        remarks, self._remarks = tuple(self._remarks), []
        return remarks

    def say_facts(self, count: Count, clock: ClockLine | None, timeline: Timeline | None) -> None:
        """Rewrite the header lines on frames and clocks."""
        if self.is_begun:
            self.fill("frames", count.sentence())
            self.fill("clock", clock_sentence(clock, timeline))

    def close(self) -> None:
        """Write pending rows and close the log; delete a log without any row."""
        super().close()
        if not self.is_begun:
            self.path.unlink(missing_ok=True)


RETRY_S = 0.25
MOST_QUEUED_BYTES = 512 * 1024 * 1024

READ_AHEAD_BYTES = 1 << 20
"""Bytes that may wait in the queue when reading a file, which can pause; a device cannot."""


class SourceReturned(Exception):
    """The device has reconnected."""


class Stopped(Exception):
    """The user has stopped the capture."""


class ReadingThread:
    """Reads a source into a queue, waits for a disconnected device, and queues these events in order.

    Items are ``(host_s, bytes)`` or ``(host_s, exception)``: `SourceLostError`, `SourceReturned`, `SourceEndedError`,
    `Stopped`, or another exception of the source; one of the last three is the last item. ``first_bytes``, which were
    read before, are the first item; ``now_s`` returns the time of the host's clock [s].
    """

    def __init__(
        self, source: Source, *, first_bytes: bytes, wait_for_return_s: float, now_s: Callable[[], float]
    ) -> None:
        self._source, self._first, self._wait_s, self._now_s = source, first_bytes, wait_for_return_s, now_s
        self._queue: queue.SimpleQueue[tuple[float, bytes | Exception]] = queue.SimpleQueue()
        self._put_bytes = self._taken_bytes = 0  # each written by one thread only
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read, name="capture reader", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Stop reading; bytes received before stay in the queue."""
        self._stop.set()

    def join(self, timeout_s: float) -> None:
        """Stop, and wait until the thread has ended if it was started."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join(timeout=timeout_s)

    def get(self, timeout_s: float) -> tuple[float, bytes | Exception]:
        """The next item; raises ``queue.Empty`` where none arrives within ``timeout_s``."""
        host_s, item = self._queue.get(timeout=timeout_s)
        if isinstance(item, bytes):
            self._taken_bytes += len(item)
        return host_s, item

    @property
    def _waiting_bytes(self) -> int:
        return self._put_bytes - self._taken_bytes

    def _put(self, item: bytes | Exception) -> None:
        if isinstance(item, bytes):
            self._put_bytes += len(item)
        self._queue.put((self._now_s(), item))

    def _read(self) -> None:
        if self._first:
            self._put(self._first)
        while not self._stop.is_set():
            try:
                data = self._source.read()
            except SourceLostError as error:
                self._put(error)
                if not self._wait_for_return():
                    self._put(SourceEndedError(str(error)))
                    return
                self._put(SourceReturned(self._source.name))
                continue
            except Exception as error:  # passed to the recorder's loop, which raises it
                self._put(error)
                return
            if data:
                self._put(data)
                while not self._source.is_live and self._waiting_bytes > READ_AHEAD_BYTES and not self._stop.is_set():
                    time.sleep(0.002)
            if self._waiting_bytes > MOST_QUEUED_BYTES:
                self._put(CaptureError("the disk is slower than the device and memory is full; use a faster disk."))
                return
        self._put(Stopped())

    def _wait_for_return(self) -> bool:
        until = time.monotonic() + self._wait_s
        while not self._stop.is_set() and time.monotonic() < until:
            if self._source.reopen():
                return True
            self._stop.wait(RETRY_S)
        return False
