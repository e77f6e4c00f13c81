"""Indices of frames from the device's counter or clock, with losses counted and located.

Most simple protocols have no checksum, so a counter may itself be corrupt. A frame that does not follow the last one
by one step therefore waits until later frames show whether frames are missing before it, or its counter is wrong.
"""

from collections import deque
from itertools import pairwise
from statistics import median
from typing import NamedTuple

from trihedron.capture.timeline import Count
from trihedron.protocols.framing import Frame

LEARN = 8
"""Frames from which the clock's step is first estimated (mean of the steps up to 1.6 times their median)."""

MOST_WAITING = 12
"""Contradicting frames that may wait before the longest increasing run is accepted."""

MOST_LOST = 10_000
"""Frames; a counter that jumps further was reset."""

MOST_SILENT_S = 3600.0
"""Seconds; a clock that jumps further was set."""

LONG_GAP = 50
"""Steps after which the uncertainty of the step makes the expected timestamp useless."""

AGREEMENT = 0.35
"""Largest deviation, in steps, of the difference of two timestamps from one step at which they confirm each other."""

COARSE = 2.4
"""Ticks per frame below which rounding moves a timestamp by much of a frame: a step of two may then be one, and
single losses cannot be counted (only gaps longer than ``COARSE_SPAN`` ticks)."""

COARSE_SPAN = 8

SENT_TWICE = 64
"""Frames; the farthest back at which a section of the stream that is sent twice may begin."""

_WRAPS = (1 << 8, 1 << 16, 1 << 32)


class Placed(NamedTuple):
    """A frame with its index in the stream; ``lost`` frames are missing before it, unless the device ``restarted``.
    With ``is_wrapped`` more may be missing, because a short counter may have wrapped."""

    place: int
    lost: int
    restarted: bool
    host_s: float
    frame: Frame
    is_wrapped: bool = False


class Sequence:
    """Assigns an index to every frame, by counter or clock; without both, frames are consecutive.

    ``modulus`` is the value at which counter or clock wraps (0: it does not), ``tick_s`` one tick of the clock [s];
    ``count`` is added to.
    """

    def __init__(
        self,
        *,
        by_counter: bool = False,
        by_clock: bool = False,
        modulus: int = 0,
        tick_s: float = 0.0,
        count: Count | None = None,
    ) -> None:
        self._by_counter, self._by_clock = by_counter, by_clock and not by_counter
        self._modulus = modulus
        self._tick_s = tick_s
        self._period = 0.0
        self.is_coarse = False
        self._last: int | None = None
        self._placed: deque[Frame] = deque(maxlen=SENT_TWICE + 1)
        # Delay of the last timestamp against a steady clock, in ticks.
        self._late = 0.0
        self._index = -1
        self._waiting: list[tuple[float, Frame]] = []
        self._first_host_s = self._last_host_s = 0.0
        self.count = Count() if count is None else count
        self.count.counted_by = "counter" if by_counter else "clock" if by_clock else "nothing"

    @property
    def n_frames(self) -> int:
        """Number of frames up to the last one placed, lost ones included."""
        return self._index + 1

    def push(self, frames: list[Frame], host_s: float) -> list[Placed]:
        """Place frames that arrived at ``host_s`` of the host's clock; some may wait for later ones."""
        out: list[Placed] = []
        if not (self._by_counter or self._by_clock):
            for frame in frames:
                self._index += 1
                out.append(Placed(self._index, 0, False, host_s, frame))
            self.count.saved += len(out)
            return out
        for frame in frames:
            before = self._waiting[-1][1] if self._waiting else self._placed[-1] if self._placed else None
            if frame == before and not self.is_coarse:
                self.count.repeated += 1
                continue
            self._waiting.append((host_s, frame))
            if self._last is None or (self._by_clock and self._period == 0.0):
                if len(self._waiting) >= LEARN:
                    self._begin(out)
            elif len(self._waiting) == 1 and self._ahead(self._key(frame)) == 1:
                self._accept(1, out)
            else:
                self._resolve(out)
        return out

    def finish(self) -> list[Placed]:
        """Place the frames that still wait, at the end of the stream."""
        out: list[Placed] = []
        if self._last is None and self._waiting:
            self._begin(out)
        if self._waiting:
            self._longest(out)
        return out

    def missing_until(self, frame: Frame, most: int) -> int | None:
        """Number of frames between the last one placed here and ``frame`` of a later connection, by counter or clock.

        None where it is unknown: there is no counter and no usable clock, the device restarted, the number exceeds
        ``most``, or the counter may have wrapped in between.
        """
        if self._last is None or not (self._by_counter or (self._by_clock and self._period > 0.0)) or self.is_coarse:
            return None
        in_keys = most if self._by_counter else most * self._period
        if self._modulus and in_keys >= self._modulus // 2:
            return None
        steps = self._ahead(self._key(frame))
        return steps - 1 if 0 < steps <= most else None

    def _key(self, frame: Frame) -> int:
        key = frame.counter if self._by_counter else frame.ticks
        return 0 if key is None else key

    def _difference(self, a: int, b: int) -> int:
        difference = b - a
        modulus = self._modulus
        if modulus:
            difference %= modulus
            return difference - modulus if difference > modulus // 2 else difference
        if difference < 0 and self._by_counter:
            # The modulus of a counter printed as text is unknown: try the usual ones.
            for wrap in _WRAPS:
                if 0 < difference + wrap <= 64:
                    return difference + wrap
        return difference

    def _steps(self, a: int, b: int) -> int:
        difference = self._difference(a, b)
        if self._by_counter or (difference == 0 and not self.is_coarse):
            return difference
        if self.is_coarse and 0 <= difference <= COARSE_SPAN:
            return 1
        steps = round(difference / self._period)
        return steps if steps else (1 if difference > 0 else -1)

    def _follows(self, a: int, b: int) -> bool:
        """Whether two keys differ by one step, which is evidence that both are right."""
        if self._by_counter or self.is_coarse:
            return self._steps(a, b) == 1
        return abs(self._difference(a, b) / self._period - 1.0) < AGREEMENT

    def _agree_of_three(self) -> bool:
        """Whether three waiting keys increase; with a coarse clock a frame sent twice would confirm itself."""
        if len(self._waiting) < 3:
            return False
        first, second, third = (self._key(frame) for _, frame in self._waiting[-3:])
        return self._follows(first, second) and self._difference(first, third) > 0

    def _ahead(self, key: int) -> int:
        """Steps from the last placed frame to ``key``, corrected for the delay of the last timestamp."""
        assert self._last is not None
        difference = self._difference(self._last, key)
        if self._by_counter or self.is_coarse or difference == 0:
            return self._steps(self._last, key)
        steps = round((difference + self._late) / self._period)
        return steps if steps > 0 else (1 if difference > 0 else min(steps, -1))

    @property
    def _most(self) -> int:
        if self._by_counter:
            return min(MOST_LOST, self._modulus // 2 or MOST_LOST)
        return int(MOST_SILENT_S / max(self._period * self._tick_s, 1e-9))

    def _begin(self, out: list[Placed]) -> None:
        keys = [self._key(frame) for _, frame in self._waiting]
        differences = [self._difference(a, b) for a, b in pairwise(keys)]
        if self._by_clock and self._period == 0.0:
            forward = [d for d in differences if d > 0] or [1]
            usual = [d for d in forward if d <= 1.6 * median(forward)]
            # Equal timestamps are consecutive frames within one tick, not repeats.
            n = len(usual) + sum(d == 0 for d in differences)
            self._period = sum(usual) / n
            self.is_coarse = self._period < COARSE
        # Start with the first frame that one of the next three continues.
        steps = [[self._steps(a, b) for b in keys[i + 1 : i + 4]] for i, a in enumerate(keys)]
        first = next((i for i, ahead in enumerate(steps) if any(0 < s <= 4 for s in ahead)), 0)
        self.count.garbled += first
        del self._waiting[:first]
        self._accept(1, out)
        rest, self._waiting = self._waiting, []
        for one in rest:
            self._waiting.append(one)
            self._resolve(out)

    def _resolve(self, out: list[Placed]) -> None:
        """Place the waiting frames if the newest, just added, decides their order."""
        waiting = self._waiting
        newest = self._key(waiting[-1][1])
        if self._ahead(newest) == len(waiting):
            # It is where it should be if those between only have a wrong counter, or an early or late timestamp.
            self._in_place(out)
            return
        if len(waiting) >= 2:
            before = self._key(waiting[-2][1])
            if self._follows(before, newest) and (not self.is_coarse or self._agree_of_three()):
                ahead = self._ahead(before)
                if 0 < ahead <= self._most:
                    self._between(len(waiting) - 2, before, out)
                    self._accept(max(self._ahead(before), 1), out)
                    self._accept(1, out)
                    return
                if len(waiting) >= 3 and self._follows(self._key(waiting[-3][1]), before):
                    self._restart(len(waiting) - 3, ahead, out)
                    return
        if len(waiting) > MOST_WAITING:
            self._longest(out)

    def _in_place(self, out: list[Placed]) -> None:
        """Place all waiting frames: there are as many as steps to the newest, so none is missing."""
        first, n = self._index, len(self._waiting)
        newest = self._key(self._waiting[-1][1])
        for place in range(1, n):
            key = self._key(self._waiting[0][1])
            ahead = first + place - self._index if self._by_clock else self._ahead(key)
            if self._ahead(key) > 0 and self._difference(key, newest) > 0 and ahead <= first + n - 1 - self._index:
                self._accept(ahead, out)
            else:
                self._drop()
        self._accept(first + n - self._index, out)

    def _between(self, n: int, until: int, out: list[Placed]) -> None:
        """Of the first ``n`` waiting frames accept those in order between the last placed one and ``until``."""
        for _ in range(n):
            key = self._key(self._waiting[0][1])
            ahead, left = self._ahead(key), self._steps(key, until)
            if 0 < ahead <= self._most and left > 0 and ahead < self._ahead(until):
                self._accept(ahead, out)
            else:
                self._drop()

    def _drop(self) -> None:
        _, frame = self._waiting.pop(0)
        assert self._last is not None
        if self._difference(self._last, self._key(frame)) == 0:
            self.count.repeated += 1
        else:
            self.count.garbled += 1

    def _restart(self, n: int, ahead: int, out: list[Placed]) -> None:
        """Three consecutive frames show that the counter restarted, or that a section was sent twice."""
        is_behind = -SENT_TWICE <= ahead <= 0 and not self._may_have_wrapped(self._waiting[-1][0])
        if is_behind and any(frame in self._placed for _, frame in self._waiting):
            self.count.repeated += len(self._waiting)
            self._waiting.clear()
            return
        for _ in range(n):
            self._drop()
        self.count.restarts += 1
        self._accept(1, out, restarted=True)
        while self._waiting:
            self._accept(1, out)

    def _longest(self, out: list[Placed]) -> None:
        """Accept the longest run of increasing keys and drop the other waiting frames."""
        keys = [self._key(frame) for _, frame in self._waiting]
        best: list[list[int]] = []
        for i, key in enumerate(keys):
            if not 0 < self._ahead(key) <= self._most:
                best.append([])
                continue
            fits = [run for run in best if run and 0 < self._steps(keys[run[-1]], key) <= self._most]
            best.append([*_longest_of(fits), i])
        chosen = set(_longest_of(best))
        for i in range(len(keys)):
            if i in chosen:
                self._accept(max(self._ahead(keys[i]), 1), out)
            else:
                self._drop()

    def _accept(self, ahead: int, out: list[Placed], *, restarted: bool = False) -> None:
        """Place the first waiting frame, ``ahead`` steps after the last placed one."""
        host_s, frame = self._waiting.pop(0)
        if self.n_frames == 0:
            self._first_host_s = host_s
        self._index += ahead
        key = self._key(frame)
        if self._by_clock and self._last is not None:
            surprise = self._difference(self._last, key) + self._late - ahead * self._period
            if restarted or ahead > LONG_GAP:
                self._late = 0.0
            else:
                # The step is filtered slowly, the phase faster; the effect of one timestamp on the step is limited.
                limit = 0.3 * self._period
                gain = max(1e-3, 1.0 / (LEARN + self.n_frames))
                self._period += gain * min(max(surprise / ahead, -limit), limit)
                self._late = 0.8 * surprise
        self._last = key
        self._placed.append(frame)
        is_wrapped = ahead > 1 and self._may_have_wrapped(host_s)
        self._last_host_s = host_s
        self.count.saved += 1
        self.count.missing += ahead - 1
        self.count.uncounted += is_wrapped
        out.append(Placed(self._index, ahead - 1, restarted, host_s, frame, is_wrapped))

    def _may_have_wrapped(self, host_s: float) -> bool:
        """Whether the pause before ``host_s`` is long enough for the counter to have advanced by half its modulus."""
        span_s = self._last_host_s - self._first_host_s
        if not (self._by_counter and self._modulus and span_s > 0.0):
            return False
        rate_hz = self.n_frames / span_s
        return (host_s - self._last_host_s) * rate_hz >= self._modulus // 2


def _longest_of(runs: list[list[int]]) -> list[int]:
    return max(runs, key=len) if runs else []
