"""Time of every frame while it is recorded, and the summary of a capture."""

from dataclasses import dataclass

from trihedron.arrivals import ClockFit, ClockLine


class Timeline:
    """Time of every frame [s]: by the device's clock if it has one, else by frame index and the rate of arrivals.

    The time of a connection continues that of the previous one, after the gap measured by the host's clock. ``tick_s``
    is one tick of the device's clock [s], 0 without one.
    """

    def __init__(self, *, tick_s: float, modulus: int, nominal_rate_hz: float | None = None) -> None:
        self.tick_s, self._modulus = tick_s, modulus
        self.fit = ClockFit()
        self._ticks: int | None = None
        self._elapsed = 0
        self._start_s = 0.0
        self._index0 = 0
        self._time_s = 0.0
        self._host_s = 0.0
        self._index: int | None = None
        self._period = 1.0 / nominal_rate_hz if nominal_rate_hz else 0.0
        self._is_given = nominal_rate_hz is not None
        self._next_look_s = 0.0

    @property
    def has_device_clock(self) -> bool:
        """Whether times are from the device's clock."""
        return self.tick_s > 0.0

    def expect(self, period_s: float) -> None:
        """Set the first estimate of the seconds per frame, from the first arrivals; a given rate is kept."""
        if not self._is_given and self._period == 0.0:
            self._period = period_s

    def place(self, index: int, ticks: int | None, host_s: float, *, restarted: bool) -> float:
        """Time of one frame [s], never earlier than that of the previous frame."""
        if self._index is None or restarted:
            self._begin(index, ticks, host_s)
        elif self.has_device_clock and ticks is not None and self._ticks is not None:
            step = ticks - self._ticks
            if self._modulus:
                step %= self._modulus
                step = step - self._modulus if step > self._modulus // 2 else step
            self._elapsed += step
            self._ticks = ticks
            self._time_s = max(self._start_s + self._elapsed * self.tick_s, self._time_s)
        else:
            self._time_s += (index - self._index) * self._step(index)
        self._index, self._host_s = index, host_s
        return self._time_s

    def arrived(self, host_s: float) -> None:
        """Add the arrival time ``host_s`` of the bytes that contained the last placed frame to the clock fit."""
        if self._index is None:
            return
        if self.has_device_clock:
            self.fit.add(self._elapsed * self.tick_s, host_s)
        else:
            self.fit.add(self._index - self._index0, host_s)

    def _begin(self, index: int, ticks: int | None, host_s: float) -> None:
        if self._index is not None:
            self._start_s = self._time_s + max(host_s - self._host_s, self._period)
            self._time_s = self._start_s
            self.fit = ClockFit()
        self._ticks, self._elapsed, self._index0 = ticks, 0, index

    def _step(self, index: int) -> float:
        """Seconds per frame: the given rate, or the slope of the arrivals so far, fitted anew after every 20 % more."""
        if self._is_given:
            return self._period
        if index - self._index0 >= self._next_look_s:
            line = self.fit.line()
            if line is not None:
                self._period = line.slope
                self._next_look_s = (index - self._index0) * 1.2
        return self._period or STARTING_STEP_S


STARTING_STEP_S = 0.01
"""Seconds per frame assumed until the arrivals determine the rate."""


# Summary of a capture: frames saved, lost and corrupt, and the device's clock against the host's.

MOST_PPM = 20_000.0
"""A larger rate difference is no clock error, but a replay at another speed or a misread unit of time."""


@dataclass
class Count:
    """Counts of a capture: ``saved`` frames, ``missing`` ones by the device's counter or clock; ``garbled`` were
    complete, but their counter or timestamp contradicted their neighbours' (also counted as missing); ``repeated``
    arrived twice. In ``uncounted`` pauses more may be lost than counted. ``corrupt`` pieces look like frames."""

    saved: int = 0
    missing: int = 0
    garbled: int = 0
    repeated: int = 0
    restarts: int = 0
    uncounted: int = 0
    corrupt: int = 0
    skipped_bytes: int = 0
    n_bytes: int = 0
    disconnections: int = 0
    counted_by: str = "nothing"

    @property
    def lost(self) -> int:
        """Frames sent but not in the log: by counter or clock; without either, the number of corrupt pieces."""
        return self.corrupt if self.counted_by == "nothing" else self.missing

    @property
    def is_least(self) -> bool:
        """Whether ``lost`` is a lower bound: the counter restarted, or may have wrapped unnoticed in a pause."""
        return self.counted_by != "nothing" and bool(self.restarts or self.uncounted)

    def sentence(self) -> str:
        """The counts as one sentence, for the screen and the log's header."""
        how = {
            "counter": "by the device's counter",
            "clock": "by the device's clock",
            "nothing": "as far as remains were seen: there is no counter and no clock",
        }[self.counted_by]
        parts = [f"{self.saved} saved", f"{'at least ' if self.is_least else ''}{self.lost} lost {how}"]
        for n, words in (
            (self.corrupt if self.counted_by != "nothing" else 0, "corrupt pieces seen"),
            (self.garbled, "with a garbled count"),
            (self.repeated, "repeated"),
            (self.disconnections, "disconnections"),
            (self.restarts, "restarts of the device"),
        ):
            if n:
                parts.append(f"{n} {words}")
        return " / ".join(parts)


def clock_sentence(line: ClockLine | None, timeline: Timeline | None) -> str:
    """Offset, rate and arrival jitter as one sentence, for the screen and the log's header."""
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
