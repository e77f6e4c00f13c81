"""The thread that only reads the source and never waits for a disk or a decoder."""

import queue
import threading
import time
from collections.abc import Callable

from trihedron.capture.errors import CaptureError, SourceEndedError, SourceLostError
from trihedron.capture.sources import Source

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
