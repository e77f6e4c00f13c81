"""The host's clock and the device's: which line joins them, and how late bytes arrive."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

MOST_POINTS = 100_000
MOST_BINS = 200
LEAST_SPAN_S = 1.0


@dataclass(frozen=True)
class ClockLine:
    """``host_s = offset_s + device · slope``, along the earliest arrivals.

    ``device`` is the device's clock in seconds, or a frame's index where it has none (``slope`` is then seconds per
    frame). ``sigma_slope`` is the standard error of the slope; ``jitter_rms_s`` and ``jitter_95_s`` say how much later
    than the earliest bytes arrive.
    """

    offset_s: float
    slope: float
    sigma_slope: float
    jitter_rms_s: float
    jitter_95_s: float
    span_s: float

    @property
    def rate_ppm(self) -> float:
        """By how much the device's second is shorter than the host's (its clock fast), in parts per million."""
        return (1.0 / self.slope - 1.0) * 1e6

    @property
    def sigma_ppm(self) -> float:
        """Standard error of ``rate_ppm``."""
        return self.sigma_slope / self.slope**2 * 1e6


class ClockFit:
    """Collects (device, host) instants of arrivals and fits their lower edge.

    A byte can be late, never early: delays of buffers and of the operating system only add. So the line runs through
    the earliest arrival of each stretch, not through the mean.
    """

    def __init__(self) -> None:
        self._device: list[float] = []
        self._host: list[float] = []
        self._stride = 1
        self._count = 0

    def add(self, device: float, host_s: float) -> None:
        """One arrival: the last frame of a piece of bytes."""
        self._count += 1
        if self._count % self._stride:
            return
        self._device.append(device)
        self._host.append(host_s)
        if len(self._device) >= MOST_POINTS:
            del self._device[::2], self._host[::2]
            self._stride *= 2

    def line(self) -> ClockLine | None:
        """The line so far; None before a second has passed or ten pieces have come."""
        if len(self._device) < 10 or self._host[-1] - self._host[0] < LEAST_SPAN_S:
            return None
        device, host = np.array(self._device), np.array(self._host)
        d0, h0 = device[0], host[0]
        x, y = device - d0, host - h0
        if x[-1] <= 0.0:
            return None
        slope, offset = float(y[-1] / x[-1]), 0.0
        n_bins = int(min(MOST_BINS, max(4, len(x) // 25)))
        bins = np.minimum((x / x[-1] * n_bins).astype(np.int64), n_bins - 1)
        sigma = math.inf
        for _ in range(3):
            order = np.lexsort((y - slope * x, bins))
            first = order[np.unique(bins[order], return_index=True)[1]]
            px, py = x[first], y[first]
            # Stretches in which every arrival was late say little: twice the median distance is excluded.
            residual = py - slope * px
            residual -= np.median(residual)
            keep = np.abs(residual) <= 4.0 * max(float(np.median(np.abs(residual))), 1e-9)
            px, py = px[keep], py[keep]
            if len(px) < 3:
                break
            mean = px.mean()
            sxx = float(np.sum((px - mean) ** 2))
            if sxx <= 0.0:
                break
            slope = float(np.sum((px - mean) * (py - py.mean())) / sxx)
            offset = float(py.mean() - slope * mean)
            left = py - offset - slope * px
            sigma = math.sqrt(float(np.sum(left**2)) / max(len(px) - 2, 1) / sxx)
        late = y - slope * x
        late -= np.quantile(late, 0.001)
        return ClockLine(
            offset_s=h0 + offset - slope * d0,
            slope=slope,
            sigma_slope=sigma,
            jitter_rms_s=float(np.std(late)),
            jitter_95_s=float(np.quantile(late, 0.95)),
            span_s=float(y[-1]),
        )


class Timeline:
    """Seconds of every frame for the log: the device's clock where it has one, else its frames paced by the host's.

    One connection is one stretch; a new stretch goes on where the host's clock says.
    """

    def __init__(self, *, tick_s: float, modulus: int, nominal_rate_hz: float | None = None) -> None:
        self._tick_s, self._modulus = tick_s, modulus
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
        """Whether times are the device's."""
        return self._tick_s > 0.0

    @property
    def tick_s(self) -> float:
        """One tick of the device's clock; 0 without one."""
        return self._tick_s

    def expect(self, period_s: float) -> None:
        """A first guess of the seconds per frame, from the first arrivals; a rate that was given stays."""
        if not self._is_given and self._period == 0.0:
            self._period = period_s

    def place(self, index: int, ticks: int | None, host_s: float, *, restarted: bool) -> float:
        """Time of one frame, never before the one before."""
        if self._index is None or restarted:
            self._begin(index, ticks, host_s)
        elif self.has_device_clock and ticks is not None and self._ticks is not None:
            step = ticks - self._ticks
            if self._modulus:
                step %= self._modulus
                step = step - self._modulus if step > self._modulus // 2 else step
            self._elapsed += step
            self._ticks = ticks
            self._time_s = max(self._start_s + self._elapsed * self._tick_s, self._time_s)
        else:
            self._time_s += (index - self._index) * self._step(index)
        self._index, self._host_s = index, host_s
        return self._time_s

    def arrived(self, host_s: float) -> None:
        """The piece of bytes that held the last placed frame came now."""
        if self._index is None:
            return
        if self.has_device_clock:
            self.fit.add(self._elapsed * self._tick_s, host_s)
        else:
            self.fit.add(self._index - self._index0, host_s)

    def _begin(self, index: int, ticks: int | None, host_s: float) -> None:
        if self._index is not None:
            self._start_s = self._time_s + max(host_s - self._host_s, self._period)
            self._time_s = self._start_s
            self.fit = ClockFit()
        self._ticks, self._elapsed, self._index0 = ticks, 0, index

    def _step(self, index: int) -> float:
        """Seconds per frame by the arrivals so far, and a little more or less to stay beside them."""
        if self._is_given:
            return self._period
        if index - self._index0 >= self._next_look_s:
            line = self.fit.line()
            if line is not None:
                self._period = line.slope
                self._next_look_s = (index - self._index0) * 1.2
        return self._period or STARTING_STEP_S


STARTING_STEP_S = 0.01
"""Taken in the first second, while the arrivals do not tell the rate."""
