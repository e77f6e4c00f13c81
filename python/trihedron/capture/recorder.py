"""Records a stream: a thread that only reads, and a loop that decodes, counts, assigns times and writes."""

import queue
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.arrivals import ClockLine
from trihedron.capture.detection import silent
from trihedron.capture.errors import CaptureError, SourceEndedError, SourceLostError
from trihedron.capture.log import GrowingLog
from trihedron.capture.reading import ReadingThread, SourceReturned, Stopped
from trihedron.capture.sequence import Placed, Sequence
from trihedron.capture.sources import Source
from trihedron.capture.timeline import Count, Timeline, clock_sentence
from trihedron.protocols.framing import Decoder

SETTLE_S = 0.6
"""Without a device clock, rows wait this long [s] at the start of a connection, until arrivals give their rate."""

FILL_S = 2.0
"""Seconds between updates of the header lines on frames and clocks."""

AWAY_MARGIN, AWAY_FRAMES = 2.0, 64
"""While the device is disconnected its counter advances by at most twice the frames that the host's clock allows, and
64 frames from buffers; beyond that it has restarted."""

WAIT_FOR_RETURN_S = 60.0
SILENCE_S = 5.0


@dataclass(frozen=True, eq=False)
class Block:
    """Frames emitted together: ``time_s`` and ``host_s`` (n,) [s], ``index`` (n,), ``values`` (n, k) of ``columns``."""

    time_s: FloatArray
    host_s: FloatArray
    index: IntArray
    values: FloatArray
    columns: tuple[str, ...]
    remarks: tuple[str, ...] = ()


class Recorder:
    """Reads a source until it ends or :meth:`stop`; iterating yields :class:`Block` after block and writes the log.

    ``make_decoder`` makes a decoder for every connection; ``rate_hz`` is that of a device without a clock, if known;
    ``first_bytes`` were read to detect the protocol.

    Raises ``CaptureError`` from iterating: a silent device, a full disk, no frames at all; the message says what was
    saved.
    """

    def __init__(
        self,
        source: Source,
        make_decoder: Callable[[], Decoder],
        path: Path,
        *,
        overwrite: bool = False,
        rate_hz: float | None = None,
        wait_for_return_s: float = WAIT_FOR_RETURN_S,
        silence_s: float = SILENCE_S,
        first_bytes: bytes = b"",
    ) -> None:
        self.source = source
        self.count = Count()
        self.clock: ClockLine | None = None
        self.ended_because = ""
        self._make = make_decoder
        self._decoder = make_decoder()
        self._rows = GrowingLog(path, source, rate_hz, overwrite=overwrite)
        self._rate_hz = rate_hz
        self._wait_s, self._silence_s = wait_for_return_s, silence_s
        self._sequence: Sequence | None = None
        self._timeline: Timeline | None = None
        self._new_connection = True
        self._before: Sequence | None = None  # sequence of the previous connection
        self._first_host_s = self._last_host_s = 0.0
        self._held: list[Placed] = []
        self._held_since_s: float | None = None
        self._start_s = time.monotonic()
        self._filled_s = 0.0
        self._reading = ReadingThread(
            source, first_bytes=first_bytes, wait_for_return_s=wait_for_return_s, now_s=self._now_s
        )

    def stop(self) -> None:
        """Stop reading; bytes received before are still written."""
        self._reading.stop()

    def _now_s(self) -> float:
        return time.monotonic() - self._start_s

    def write_now(self) -> None:
        """Write all pending rows, so that the log can be read while it grows."""
        self._rows.flush(force=True)

    def clock_text(self) -> str:
        """Offset and rate of the device's clock against the host's, as one sentence."""
        return clock_sentence(self.clock, self._timeline)

    def __iter__(self) -> Iterator[Block]:
        self._reading.start()
        try:
            yield from self._run()
        except BaseException:
            self._reading.stop()
            self._rows.abandon()
            raise
        finally:
            self._reading.join(2.0)
            self.source.close()

    # The loop.

    def _run(self) -> Iterator[Block]:
        heard_s: float | None = None
        is_away = False
        while True:
            try:
                host_s, item = self._reading.get(0.1)
            except queue.Empty:
                self._rows.flush()
                quiet = self._now_s() - (heard_s or 0.0)
                if heard_s is None and quiet > self._silence_s:
                    raise silent(self.source, self._silence_s) from None
                continue
            if isinstance(item, bytes):
                heard_s = host_s
                self.count.n_bytes += len(item)
                yield from self._emit(self._place(self._decoder.feed(item), host_s), host_s)
                self._give_up_if_wrong(host_s)
                continue
            if isinstance(item, SourceLostError):
                is_away = True
                yield from self._part(host_s)
                self.count.disconnections += 1
                self._rows.say(f"{str(item).rstrip('.')} at {host_s:.3f} s of the host's clock")
                self._rows.flush(force=True)
                continue
            if isinstance(item, SourceReturned):
                is_away = False
                self._rows.say(f"{item} is back at {host_s:.3f} s; the time it was away is a gap in the log")
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
            self._sequence = Sequence(
                by_counter=by_counter, by_clock=by_clock, modulus=modulus, tick_s=decoder.tick_s, count=self.count
            )
            if self._timeline is None:
                tick = decoder.tick_s if by_clock else 0.0
                self._timeline = Timeline(tick_s=tick, modulus=decoder.clock_modulus, nominal_rate_hz=self._rate_hz)
        return self._sequence.push(frames, host_s)

    def _emit(self, placed: list[Placed], host_s: float, *, is_last: bool = False) -> Iterator[Block]:
        """Assign times to placed frames and write their rows; at the start frames wait until the rate is known."""
        timeline = self._timeline
        if timeline is None or not (placed or self._held):
            return
        if not timeline.has_device_clock and self.source.is_live and not self._is_settled(placed, host_s, is_last):
            return
        if self._held:
            placed, self._held = [*self._held, *placed], []
        if not placed:
            return
        self._rows.begin(self._decoder, timeline)
        times = np.empty(len(placed))
        for i, one in enumerate(placed):
            away = self._lost_while_away(one) if self._new_connection else 0
            times[i] = self._rows.add(one, timeline, is_first=self._new_connection, lost_while_away=away)
            self._new_connection = False
        self._last_host_s = placed[-1].host_s
        timeline.arrived(host_s)
        if host_s - self._filled_s >= FILL_S:
            self._filled_s = host_s
            self._say_facts()
        self._rows.flush()
        yield Block(
            times,
            np.array([one.host_s for one in placed]),
            np.array([self._rows.index(one) for one in placed], dtype=np.int64),
            np.array([one.frame.values for one in placed], dtype=np.float64),
            self._decoder.columns,
            self._rows.take_remarks(),
        )

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

    def _lost_while_away(self, first: Placed) -> int:
        """Frames lost between two connections by the device's counter or clock, cut frames at either end included."""
        before, start_s, self._before = self._before, self._first_host_s, None
        self._first_host_s = first.host_s
        if before is None:
            return 0
        rate_hz = before.n_frames / max(self._last_host_s - start_s, SETTLE_S)
        most = int(AWAY_MARGIN * rate_hz * (first.host_s - self._last_host_s)) + AWAY_FRAMES
        missing = before.missing_until(first.frame, most)
        if missing is None:
            self._rows.say("how many frames were lost while it was away is not known from what the device sends")
            self.count.uncounted += 1
            return 0
        self.count.missing += missing
        return missing

    def _part(self, host_s: float) -> Iterator[Block]:
        """End a connection: emit complete frames in the remaining bytes, then reset decoder and sequence."""
        decoder = self._decoder
        placed = self._place(decoder.finish(), host_s)
        if self._sequence is not None:
            placed += self._sequence.finish()
        yield from self._emit(placed, host_s, is_last=True)
        if self._sequence is not None:
            self._before = self._sequence
        self._decoder, self._sequence = self._make(), None
        # The columns of the log stay: a decoder that learns them must not learn others.
        for name in ("corrupt", "skipped_bytes", *(decoder.learned if decoder.columns else ())):
            setattr(self._decoder, name, getattr(decoder, name))
        self._new_connection, self._held_since_s = True, None

    def _say_facts(self) -> None:
        self.count.corrupt, self.count.skipped_bytes = self._decoder.corrupt, self._decoder.skipped_bytes
        if self._timeline is not None and self.source.is_live:
            self.clock = self._timeline.fit.line() or self.clock
        self._rows.say_facts(self.count, self.clock, self._timeline)

    def _give_up_if_wrong(self, host_s: float) -> None:
        """Raise when ten seconds of bytes contain no frame: the protocol or the baud rate is wrong."""
        if self._rows.is_begun or self._held or host_s < 10.0 or self._sequence is not None:
            return
        raise CaptureError(
            f"{self.source.name}: {self.count.n_bytes} bytes came and not one {self._decoder.name} frame was among "
            "them; say another --baud or --protocol (without them both are found by trying)."
        )

    def _finish(self) -> None:
        self._say_facts()
        self._rows.close()
        if not self._rows.is_begun:
            heard = f"{self.count.n_bytes} bytes came" if self.count.n_bytes else "nothing came"
            raise CaptureError(
                f"{self.source.name}: {heard} and not one whole {self._decoder.name} frame; no log was written."
            )
