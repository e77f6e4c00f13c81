"""Time of every frame while it is recorded."""

from trihedron.arrivals import ClockFit


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
