"""From bytes to rows: a thread that only reads, and a loop that decodes, counts, times and writes."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import numpy.typing as npt

from trihedron.capture.clock import ClockLine, Timeline
from trihedron.capture.errors import CaptureError, SourceEndedError, SourceLostError
from trihedron.capture.log import GrowingLog
from trihedron.capture.protocols import Decoder
from trihedron.capture.sequence import Placed, Sequence, Tally
from trihedron.capture.sources import Source

FloatArray = npt.NDArray[np.float64]

SETTLE_S = 0.6
"""Without a device clock, rows wait this long at the start of a connection, until arrivals tell their rate."""

FILL_S = 2.0
"""How often the header's lines on frames and clocks are said anew."""

MOST_PPM = 20_000.0
"""Beyond two per cent it is no clock's error: a replay at another speed, or a unit of time that was misread."""

RETRY_S = 0.25
WAIT_FOR_RETURN_S = 60.0
SILENCE_S = 5.0
MOST_QUEUED_BYTES = 512 * 1024 * 1024


@dataclass(frozen=True, eq=False)
class Block:
    """Frames that came together: ``time_s`` and ``host_s`` (n,), ``index`` (n,), ``values`` (n, k) in ``columns``."""

    time_s: FloatArray
    host_s: FloatArray
    index: npt.NDArray[np.int64]
    values: FloatArray
    columns: tuple[str, ...]
    remarks: tuple[str, ...] = ()


@dataclass
class Count:
    """What became of everything that was sent."""

    tally: Tally = field(default_factory=Tally)
    corrupt: int = 0
    skipped_bytes: int = 0
    n_bytes: int = 0
    disconnections: int = 0
    counted_by: str = "nothing"

    @property
    def lost(self) -> int:
        """Frames that were sent and are not in the log: by counter or clock, else as far as remains were seen."""
        return self.corrupt if self.counted_by == "nothing" else self.tally.lost

    def sentence(self) -> str:
        """For people and for the header."""
        how = {
            "counter": "by the device's counter",
            "clock": "by the device's clock",
            "nothing": "as far as remains were seen: there is no counter and no clock",
        }[self.counted_by]
        parts = [f"{self.tally.saved} saved", f"{self.lost} lost {how}"]
        for n, words in (
            (self.corrupt if self.counted_by != "nothing" else 0, "corrupt pieces seen"),
            (self.tally.garbled, "with a garbled count"),
            (self.tally.repeated, "repeated"),
            (self.disconnections, "disconnections"),
            (self.tally.restarts, "restarts of the device"),
        ):
            if n:
                parts.append(f"{n} {words}")
        return " / ".join(parts)


class Recorder:
    """Reads a source until it ends or :meth:`stop`; iterating gives :class:`Block` after block, the log grows.

    Parameters
    ----------
    source, make_decoder
        Where bytes come from and how they are understood; a decoder is made anew for every connection.
    path : Path or None
        The log to write; without one nothing is kept.
    rate_hz : float, optional
        Rate of a device without a clock, where it is known.
    wait_for_return_s : float
        How long to wait for a device that went away.
    first_bytes : bytes
        What was read already to find out the protocol.

    Raises
    ------
    CaptureError
        From iterating: a silent device, a full disk, no frames at all; one sentence that says what was saved.
    """

    def __init__(
        self,
        source: Source,
        make_decoder: Callable[[], Decoder],
        path: Path | None = None,
        *,
        overwrite: bool = False,
        rate_hz: float | None = None,
        wait_for_return_s: float = WAIT_FOR_RETURN_S,
        silence_s: float = SILENCE_S,
        first_bytes: bytes = b"",
        log: GrowingLog | None = None,
    ) -> None:
        self.source = source
        self.count = Count()
        self.clock: ClockLine | None = None
        self.ended_because = ""
        self._make = make_decoder
        self._decoder = make_decoder()
        self._log = log if log is not None else None if path is None else GrowingLog(path, overwrite=overwrite)
        self._rate_hz = rate_hz
        self._wait_s, self._silence_s = wait_for_return_s, silence_s
        self._first = first_bytes
        self._sequence: Sequence | None = None
        self._timeline: Timeline | None = None
        self._is_begun = False
        self._held: list[Placed] = []
        self._held_since_s: float | None = None
        self._offset = 0
        self._next_index = 0
        self._remarks: list[str] = []
        self._start_s = time.monotonic()
        self._started = datetime.now(timezone.utc)
        self._filled_s = 0.0
        self._queue: queue.SimpleQueue[tuple[float, bytes | Exception]] = queue.SimpleQueue()
        self._queued = 0
        self._stop = threading.Event()
        self._time_s = 0.0

    def stop(self) -> None:
        """Take no more bytes; what came is still written."""
        self._stop.set()

    def write_now(self) -> None:
        """Put everything that has come into the log, so that it can be read while it grows."""
        if self._log is not None:
            self._log.flush(force=True)

    def clock_text(self) -> str:
        """How the host's clock and the device's go together."""
        return clock_sentence(self.clock, self._timeline)

    def __iter__(self) -> Iterator[Block]:
        reader = threading.Thread(target=self._read, name="capture reader", daemon=True)
        reader.start()
        try:
            yield from self._run()
        except BaseException:
            self._stop.set()
            if self._log is not None:
                self._log.abandon()
            raise
        finally:
            self._stop.set()
            reader.join(timeout=2.0)
            self.source.close()

    # The reading thread: nothing here may wait for a disk or a decoder.

    def _read(self) -> None:
        put = self._queue.put
        if self._first:
            put((time.monotonic() - self._start_s, self._first))
        while not self._stop.is_set():
            try:
                data = self.source.read()
            except SourceLostError as error:
                put((time.monotonic() - self._start_s, error))
                if not self._wait_for_return():
                    put((time.monotonic() - self._start_s, SourceEndedError(str(error))))
                    return
                put((time.monotonic() - self._start_s, SourceReturned(self.source.name)))
                continue
            except Exception as error:  # handed to the loop, which raises it
                put((time.monotonic() - self._start_s, error))
                return
            now = time.monotonic() - self._start_s
            if data:
                self._queued += len(data)
                put((now, data))
                if not self.source.is_live:
                    # A file can be read faster than it is decoded; a device cannot be asked to wait.
                    while self._queued > 1 << 20 and not self._stop.is_set():
                        time.sleep(0.002)
            if self._queued > MOST_QUEUED_BYTES:
                put((now, CaptureError("the disk is slower than the device and memory is full; use a faster disk.")))
                return
        put((time.monotonic() - self._start_s, Stopped()))

    def _wait_for_return(self) -> bool:
        until = time.monotonic() + self._wait_s
        while not self._stop.is_set() and time.monotonic() < until:
            if self.source.reopen():
                return True
            self._stop.wait(RETRY_S)
        return False

    # The loop.

    def _run(self) -> Iterator[Block]:
        heard_s: float | None = None
        is_away = False
        while True:
            try:
                host_s, item = self._queue.get(timeout=0.1)
            except queue.Empty:
                if self._log is not None:
                    self._log.flush()
                quiet = time.monotonic() - self._start_s - (heard_s or 0.0)
                if heard_s is None and quiet > self._silence_s:
                    raise CaptureError(
                        f"{self.source.name}: not one byte came in {self._silence_s:g} s; is the board powered and "
                        "sending, and is this its port?"
                    ) from None
                continue
            if isinstance(item, bytes):
                self._queued -= len(item)
                heard_s = host_s
                self.count.n_bytes += len(item)
                yield from self._emit(self._place(self._decoder.feed(item), host_s), host_s)
                self._give_up_if_wrong(host_s)
                continue
            if isinstance(item, SourceLostError):
                is_away = True
                yield from self._part(host_s)
                self.count.disconnections += 1
                self._say(f"{str(item).rstrip('.')} at {host_s:.3f} s of the host's clock")
                if self._log is not None:
                    self._log.flush(force=True)
                continue
            if isinstance(item, SourceReturned):
                is_away = False
                self._say(f"{item} is back at {host_s:.3f} s; the time it was away is a gap in the log")
                continue
            yield from self._part(host_s)
            if not isinstance(item, (Stopped, SourceEndedError)):
                raise item
            if is_away:
                self.ended_because = f"{str(item).rstrip('.')} and did not come back within {self._wait_s:g} s"
            self._finish()
            return

    def _place(self, frames: list, host_s: float) -> list[Placed]:  # type: ignore[type-arg]
        if not frames:
            return []
        if self._sequence is None:
            decoder, first = self._decoder, frames[0]
            by_counter, by_clock = first.counter is not None, first.ticks is not None
            modulus = decoder.counter_modulus if by_counter else decoder.clock_modulus
            self._sequence = Sequence(by_counter=by_counter, by_clock=by_clock, modulus=modulus, tick_s=decoder.tick_s)
            self.count.counted_by = "counter" if by_counter else "clock" if by_clock else "nothing"
            if self._timeline is None:
                tick = decoder.tick_s if by_clock else 0.0
                self._timeline = Timeline(tick_s=tick, modulus=decoder.clock_modulus, nominal_rate_hz=self._rate_hz)
        return self._sequence.push(frames, host_s)

    def _emit(self, placed: list[Placed], host_s: float, *, is_last: bool = False) -> Iterator[Block]:
        """Times and rows for frames that have their place; at the start some wait for a rate."""
        timeline = self._timeline
        if timeline is None or not (placed or self._held):
            return
        if not timeline.has_device_clock and self.source.is_live and not self._is_settled(placed, host_s, is_last):
            return
        if self._held:
            placed, self._held = [*self._held, *placed], []
        if not placed:
            return
        self._begin()
        times = np.empty(len(placed))
        for i, one in enumerate(placed):
            times[i] = self._row(one, is_first=self._new_connection)
            self._new_connection = False
        timeline.arrived(host_s)
        self._fill(host_s)
        if self._log is not None:
            self._log.flush()
        remarks, self._remarks = tuple(self._remarks), []
        yield Block(
            times,
            np.array([one.host_s for one in placed]),
            np.array([one.place + self._offset for one in placed], dtype=np.int64),
            np.array([one.frame.values for one in placed], dtype=np.float64),
            self._decoder.columns,
            remarks,
        )

    _new_connection = True

    def _is_settled(self, placed: list[Placed], host_s: float, is_last: bool) -> bool:
        if not self._new_connection:
            return True
        self._held += placed
        if self._held_since_s is None:
            self._held_since_s = host_s
        elapsed = host_s - self._held_since_s
        if elapsed < SETTLE_S and not is_last:
            return False
        assert self._timeline is not None
        n = self._held[-1].place - self._held[0].place
        if n > 0 and elapsed > 0:
            self._timeline.expect(elapsed / n)
        placed.clear()
        return True

    def _row(self, one: Placed, *, is_first: bool) -> float:
        timeline, log = self._timeline, self._log
        assert timeline is not None
        if is_first and self._next_index:
            self._offset = self._next_index - one.place
        index = one.place + self._offset
        fresh = one.restarted or is_first
        self._time_s = timeline.place(index, one.frame.ticks, one.host_s, restarted=fresh)
        if one.lost:
            self._say(f"lost {one.lost} before frame {index} at {self._time_s:.6f} s")
        if one.restarted:
            self._say(f"the device began to count anew before frame {index} at {self._time_s:.6f} s")
        self._next_index = index + 1
        if log is not None:
            parts = [f"{self._time_s:.6f}"] if self._has_time else []
            if self.source.is_live:
                parts.append(f"{one.host_s:.6f}")
            parts.append(str(index))
            if timeline.has_device_clock:
                parts.append(str(one.frame.ticks))
            log.row(",".join(parts) + "," + one.frame.text, self._time_s)
        return self._time_s

    @property
    def _has_time(self) -> bool:
        assert self._timeline is not None
        return self._timeline.has_device_clock or self.source.is_live or self._rate_hz is not None

    def _begin(self) -> None:
        if self._is_begun:
            return
        self._is_begun = True
        if self._log is None:
            return
        assert self._timeline is not None
        names = ["time [s]"] if self._has_time else []
        names += ["host_s"] if self.source.is_live else []
        names += ["frame", *(["device_ticks"] if self._timeline.has_device_clock else [])]
        tick = f"{self._timeline.tick_s:g} s per tick" if self._timeline.has_device_clock else "none"
        facts = {
            "protocol": self._decoder.name,
            "source": self.source.name,
            "started": self._started.isoformat(timespec="milliseconds"),
            "device clock": tick,
        }
        self._log.begin(facts, [*names, *self._decoder.columns])

    def _say(self, text: str) -> None:
        self._remarks.append(text)
        if self._log is not None and self._is_begun:
            self._log.remark(text)

    def _part(self, host_s: float) -> Iterator[Block]:
        """A connection ends: whole frames in what remains count, then decoder and sequence start anew."""
        decoder = self._decoder
        placed = self._place(decoder.finish(), host_s)
        if self._sequence is not None:
            placed += self._sequence.finish()
        yield from self._emit(placed, host_s, is_last=True)
        self._count_now()
        self._past = (self.count.corrupt, self.count.skipped_bytes, self.count.tally)
        self._decoder, self._sequence = self._make(), None
        if decoder.columns:
            _keep_layout(self._decoder, decoder)
        self._new_connection, self._held_since_s = True, None

    _past: tuple[int, int, Tally] = (0, 0, Tally())

    def _count_now(self) -> None:
        corrupt, skipped, past = self._past
        self.count.corrupt = corrupt + self._decoder.corrupt
        self.count.skipped_bytes = skipped + self._decoder.skipped_bytes
        now = self._sequence.tally if self._sequence is not None else Tally()
        self.count.tally = Tally(*(getattr(past, name) + getattr(now, name) for name in Tally.__dataclass_fields__))

    def _fill(self, host_s: float) -> None:
        if host_s - self._filled_s < FILL_S:
            return
        self._filled_s = host_s
        self._say_facts()

    def _say_facts(self) -> None:
        self._count_now()
        if self._timeline is not None and self.source.is_live:
            self.clock = self._timeline.fit.line() or self.clock
        if self._log is None or not self._is_begun:
            return
        self._log.fill("frames", self.count.sentence())
        self._log.fill("clock", clock_sentence(self.clock, self._timeline))

    def _give_up_if_wrong(self, host_s: float) -> None:
        """Bytes for ten seconds and not one frame: another protocol or another baud."""
        if self._is_begun or self._held or host_s < 10.0 or self._sequence is not None:
            return
        raise CaptureError(
            f"{self.source.name}: {self.count.n_bytes} bytes came and not one {self._decoder.name} frame was among "
            "them; say another --baud or --protocol (without them both are found by trying)."
        )

    def _finish(self) -> None:
        self._say_facts()
        if self._log is not None:
            self._log.close()
        if not self._is_begun:
            if self._log is not None:
                self._log.path.unlink(missing_ok=True)
            heard = f"{self.count.n_bytes} bytes came" if self.count.n_bytes else "nothing came"
            raise CaptureError(
                f"{self.source.name}: {heard} and not one whole {self._decoder.name} frame; no log was written."
            )


class SourceReturned(Exception):
    """The device is back."""


class Stopped(Exception):
    """The user said stop."""


def clock_sentence(line: ClockLine | None, timeline: Timeline | None) -> str:
    """Offset, rate and arrival jitter, for people and for the header."""
    if line is None or timeline is None:
        return "not fitted: too short or not live"
    late = f"bytes arrive {1e3 * line.jitter_rms_s:.3g} ms rms and {1e3 * line.jitter_95_s:.3g} ms (95 %) late"
    if timeline.has_device_clock:
        if abs(line.rate_ppm) > MOST_PPM:
            return f"the device's clock runs {1.0 / line.slope:.4g} times as fast as the host's / {late}"
        return (
            f"device second = host second {line.rate_ppm:+.2f} ppm +- {line.sigma_ppm:.2f} / device zero at host "
            f"{line.offset_s:.6f} s / {late}"
        )
    sigma = 100.0 * line.sigma_slope / line.slope
    return f"{1.0 / line.slope:.6f} frames per second of the host +- {sigma:.2g} % / {late}"


def _keep_layout(new: Decoder, old: Decoder) -> None:
    """After a reconnection the columns are those of the log; a protocol that learns them must not learn others."""
    adopt = getattr(new, "adopt", None)
    if adopt is not None:
        adopt(old)
