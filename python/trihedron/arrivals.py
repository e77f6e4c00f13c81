"""The host's clock against the device's: the line between them, and the delay of arriving bytes."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from trihedron.arrays import FloatArray

MOST_POINTS = 100_000
MOST_BINS = 200
LEAST_SPAN_S = 1.0


@dataclass(frozen=True)
class ClockLine:
    """``host_s = offset_s + device · slope``, along the earliest arrivals.

    ``device`` is the device's clock in seconds, or a frame's index where it has none (``slope`` is then seconds per
    frame). ``sigma_slope`` is the standard error of the slope; ``jitter_rms_s`` and ``jitter_95_s`` are the standard
    deviation and the 95 % quantile of the delay.
    """

    offset_s: float
    slope: float
    sigma_slope: float
    jitter_rms_s: float
    jitter_95_s: float
    span_s: float

    @property
    def rate_ppm(self) -> float:
        """Rate error of the device's clock [ppm]; positive where it runs fast."""
        return (1.0 / self.slope - 1.0) * 1e6

    @property
    def sigma_ppm(self) -> float:
        """Standard error of ``rate_ppm``."""
        return self.sigma_slope / self.slope**2 * 1e6


class ClockFit:
    """Collects (device, host) instants of arrivals and fits their lower edge.

    Delays of buffers and of the operating system are never negative, so that the line is fitted to the earliest arrival
    of each interval, not to the mean.
    """

    def __init__(self) -> None:
        self._device: list[float] = []
        self._host: list[float] = []
        self._stride = 1
        self._count = 0

    def add(self, device: float, host_s: float) -> None:
        """Add one arrival: the last frame of a piece of bytes."""
        self._count += 1
        if self._count % self._stride:
            return
        self._device.append(device)
        self._host.append(host_s)
        if len(self._device) >= MOST_POINTS:
            del self._device[::2], self._host[::2]
            self._stride *= 2

    def line(self) -> ClockLine | None:
        """The line so far; None before one second and ten pieces."""
        if len(self._device) < 10 or self._host[-1] - self._host[0] < LEAST_SPAN_S:
            return None
        device, host = np.array(self._device), np.array(self._host)
        d0, h0 = device[0], host[0]
        x, y = device - d0, host - h0
        if x[-1] <= 0.0:
            return None
        # First a fit to all arrivals: a line through the two ends would be tilted by a single early byte.
        away = x - x.mean()
        slope, offset = float(away @ y / (away @ away)), 0.0
        n_bins = int(min(MOST_BINS, max(4, len(x) // 25)))
        bins = np.minimum((x / x[-1] * n_bins).astype(np.int64), n_bins - 1)
        sigma = math.inf
        for _ in range(3):
            order = np.lexsort((y - slope * x, bins))
            first = order[np.unique(bins[order], return_index=True)[1]]
            px, py = x[first], y[first]
            # Intervals in which every arrival was late are excluded: residuals beyond four median deviations.
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


LONGEST_PAUSE_S = 0.25
"""Longest pause within one connection; after a longer one the time restarts at the next arrival."""


def paced(frame: FloatArray, host_s: FloatArray) -> FloatArray:
    """(n,) times [s] of frames (n,) without a clock of their own, from their arrivals (n,): even between two pauses.

    The period of all intervals between pauses is that of the longest one; each starts where its earliest arrivals put
    it, but not before the previous one has ended. Arrivals are returned unchanged where no interval is long enough to
    determine a period.
    """
    pauses = np.flatnonzero(np.diff(host_s) > LONGEST_PAUSE_S) + 1
    stretches = [slice(*edges) for edges in pairwise([0, *pauses.tolist(), len(host_s)])]
    longest = max(stretches, key=lambda one: host_s[one.stop - 1] - host_s[one.start])
    fit = ClockFit()
    for pair in zip(frame[longest].tolist(), host_s[longest].tolist(), strict=True):
        fit.add(*pair)
    line = fit.line()
    if line is None:
        return host_s
    out, end = np.empty(len(host_s)), -math.inf
    for one in stretches:
        pace = line.slope * (frame[one] - frame[one.start])
        out[one] = pace + max(float(np.min(host_s[one] - pace)), end + line.slope)
        end = out[one.stop - 1]
    return out
