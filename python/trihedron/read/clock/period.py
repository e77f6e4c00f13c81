"""The sampling period from timestamps alone, before losses are counted: a peak of a phase sum (docs/reading.md, 4)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.probability import chdtri
from trihedron.quantiles import quantile

WINDOW = 2048
"""Rows of one phase sum: a rate that drifts by 10⁻⁴ within it changes the phase by a fifth of a period."""
MOST_WINDOWS = 10
LOWEST, HIGHEST = 0.8, 1.9
"""Frequencies searched, per mean distance of rows: up to 45 % of all samples may be lost."""
GRID_HIGHEST = 16.0
"""Highest frequency of a grid of timestamps, per mean distance of rows; a finer grid has no effect."""
DIGIT = 1e-6
"""Resolution [s] of a step: seconds since 1970 have it as double precision."""
FINEST, ON_GRID = 0.015, 0.02
"""Finest grid among the steps, in usual steps: rounding to a finer one is no error of a clock. Largest deviation of a
step from whole grid steps."""
MOST_STEPS = 1 << 20
"""Rows whose steps are compared."""
LINE, LINE_HELD = 0.98, 0.9
"""Power of a phase sum, and of that of its eighth multiple, above which all timestamps are multiples of one step."""
LEAST = 1e-4
"""Smallest power of a peak."""
CHANCE = 1e-7
"""Probability that noise passes as a period at one of the frequencies searched (some 10⁴). Independent steps, without
an even clock, make a broad maximum as high as a line; a line is therefore compared with the power beside it."""
SLOWER = 0.985
"""Frequencies below this have fewer ticks than the log has rows, so they are no period; with a margin for error."""
MANY, PLAIN = 0.15, 0.25
"""A period with which more than the first share of samples is lost needs a power above the second number."""
FEWEST_TIMESTAMPS = 100
"""Smallest number of distinct timestamps for a period."""
WHOLE = 0.005
"""A packet contains a whole number of samples if rows per packet differ from one by less than this fraction; packets
that were lost have no rows, and none of these is missing in another."""
POLLED = 0.55
"""Lowest frequency of a beat; slower ones may be packets of two or more samples, with the period at a multiple."""
REGULAR = 0.12
"""Share of samples lost at regular intervals above which a coarse grid is the more likely cause."""
PAUSE_STEPS = 50.0
"""Number of usual steps above which a step is a pause of the logger, not a loss to be counted."""
STALL_STEPS = 120
"""Longest stall of the link, in rows; a longer one is a pause."""


@dataclass(frozen=True)
class Period:
    """``period_s``; ``coherence``: length of its phase sum (1: timestamps exactly even, 0: no period); ``grid_s``: step
    of which all timestamps are multiples, or 0; ``is_seen``: the period is significant, so losses can be counted."""

    period_s: float
    coherence: float
    grid_s: float
    is_seen: bool


def find_period(time_s: FloatArray) -> Period:
    """Period of timestamps (n,) in order; at least 64 rows.

    ``|mean exp(2πi t/T)|²`` is averaged over windows of 2048 rows. Lost samples, which are whole periods, do not move
    its peak; a delay d lowers it to ``|E exp(2πi d/T)|²``. Where several periods explain the timestamps equally well
    (batches, coarse grids) the one with the fewest lost samples is chosen.
    """
    windows, mean_step = _windows(time_s)
    cell = mean_step / (2.0 * GRID_HIGHEST)
    size = max(float(w[-1]) for w in windows) / cell
    power, length = _core.phase_power(windows, cell, int(4 * size) + 16)
    threshold = chdtri(2 * len(windows), CHANCE) / chdtri(2 * len(windows), 0.5)
    spectrum = _Spectrum(power, mean_step / (length * cell), int(2 * length / size) + 1, threshold)
    line = _first_line(windows, mean_step, spectrum)
    grid = _grid_of_steps(time_s[:MOST_STEPS]) or (mean_step / line if line else 0.0)
    steps = [np.diff(w) for w in windows]
    ends = [np.flatnonzero(step > 0.2 * mean_step) for step in steps]
    n_packets = sum(max(len(end) - 1, 0) for end in ends)
    rows = sum(int(end[-1] - end[0]) for end in ends if len(end)) / max(n_packets, 1)
    apart = float(np.median(np.concatenate([step[end] for step, end in zip(steps, ends, strict=True)])))
    best = _choose(spectrum, line, rows, apart / mean_step)
    if best is None or n_packets + len(ends) < FEWEST_TIMESTAMPS:
        return Period(mean_step, 0.0, grid, False)
    k = int(np.argmin(np.abs(spectrum.per_step - best)))
    reach = spectrum.lobe
    k = int(np.argmax(power[k - reach : k + reach + 1])) + k - reach
    period = mean_step / (_summit(power, k) * spectrum.width)
    if grid and abs(grid - period) < 0.02 * grid:
        grid = 0.0  # the period itself
    return Period(period, float(np.sqrt(power[k])), grid, True)


def _grid_of_steps(time_s: FloatArray) -> float:
    """Grid of which all steps are multiples, by their least difference; 0 where there is none, or only a finer one.

    On a grid of 1 ms steps of 20 ms at 50.001 Hz are equal but for one in a thousand: the phase sum shows no grid.
    """
    step = np.unique(np.rint(np.diff(time_s) / DIGIT)) * DIGIT
    grid = float(np.diff(step).min()) if len(step) > 1 else 0.0
    is_other = not FINEST * float(np.median(np.diff(time_s))) <= grid <= (1.0 + ON_GRID) * float(step[step > 0.0].min())
    miss = step / max(grid, DIGIT)
    return 0.0 if is_other or float(np.abs(miss - np.rint(miss)).max()) > ON_GRID else grid


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """``power`` at multiples of ``width``, the frequency step per mean distance of rows; ``lobe``: half-width of a line
    in points; ``threshold``: ratio of a line to the median power beside it that it must exceed."""

    power: FloatArray
    width: float
    lobe: int
    threshold: float

    @cached_property
    def per_step(self) -> FloatArray:
        """Frequency of every point."""
        return np.asarray(self.width * np.arange(len(self.power)))

    def peaks(self) -> IntArray:
        """Points in the search range that exceed the power beside them by ``threshold``."""
        a, b = int(LOWEST / self.width), min(int(HIGHEST / self.width) + 1, len(self.power) - 1)
        inside = self.power[a:b]
        is_peak = (inside > self.power[a - 1 : b - 1]) & (inside >= self.power[a + 1 : b + 1]) & (inside >= LEAST)
        found = a + np.flatnonzero(is_peak)
        near, far = self.lobe, 8 * self.lobe
        beside = np.concatenate([np.arange(-far, -near), np.arange(near + 1, far + 1)])
        index = np.clip(found[:, None] + beside, 0, len(self.power) - 1)
        floor = np.median(self.power[index], axis=1) if len(found) else np.zeros(0)
        return np.asarray(found[self.power[found] > self.threshold * floor], dtype=np.int64)


def _first_line(windows: list[FloatArray], mean_step: float, spectrum: _Spectrum) -> float:
    """Lowest frequency (per mean distance of rows) whose multiples all timestamps are; 0 where there is none."""
    per_step = spectrum.per_step
    high = np.flatnonzero((spectrum.power > 0.9 * LINE) & (per_step >= 0.05) & (per_step <= GRID_HIGHEST))
    while len(high):
        group = high[: int(np.searchsorted(high, high[0] + 2 * spectrum.lobe))]
        k = int(group[np.argmax(spectrum.power[group])])
        f = _summit(spectrum.power, k) * spectrum.width
        # Multiples amplify the error of the frequency, so its neighbourhood is searched finely.
        fine = f + spectrum.width * np.linspace(-0.5, 0.5, 41)
        if _mean_power(windows, fine / mean_step).max() > LINE:
            eighth = _mean_power(windows, 8 * fine / mean_step)
            if eighth.max() > LINE_HELD:
                return float(fine[int(np.argmax(eighth))])
        high = high[high > group[-1] + spectrum.lobe]
        if len(high) > 400:
            return 0.0
    return 0.0


def _mean_power(windows: list[FloatArray], frequency_hz: FloatArray) -> FloatArray:
    """Power of the phase sums of the first timestamps at every frequency (k,), evenly spaced."""
    first, step = float(frequency_hz[0]), float(frequency_hz[1] - frequency_hz[0])
    powers = [_core.direct_power(w[:512], first, step, len(frequency_hz)) for w in windows]
    return np.asarray(np.mean(powers, axis=0))


def _windows(time_s: FloatArray) -> tuple[list[FloatArray], float]:
    """Sections of the log without a pause, each starting at time 0, and the mean distance of rows [s]."""
    n = len(time_s)
    width = min(WINDOW, n)
    # A set, because `np.unique` would import masked arrays.
    starts = sorted(set(np.linspace(0, n - width, min(max(n // width, 1), MOST_WINDOWS)).astype(np.int64).tolist()))
    usual = float(np.median([(time_s[s + width - 1] - time_s[s]) / (width - 1) for s in starts]))
    kept: list[FloatArray] = []
    for s in starts:
        w = time_s[s : s + width]
        cuts = np.concatenate([[0], np.flatnonzero(np.diff(w) > PAUSE_STEPS * usual) + 1, [width]])
        longest = int(np.argmax(np.diff(cuts)))
        # Rows that a stall held back come together behind it and are none of the period's.
        piece = w[cuts[longest] + (STALL_STEPS if longest else 0) : cuts[longest + 1]]
        if len(piece) >= min(64, width // 2) and piece[-1] > piece[0]:
            kept.append(piece - piece[0])
    if not kept:
        kept = [time_s - time_s[0]]
    steps = [float(w[-1]) / (len(w) - 1) for w in kept]
    # Losses lengthen it, a stall at an end shortens it: the lower quartile is close to a window with few losses.
    return kept, quantile(np.array(steps), 0.25)


def _poll(spectrum: _Spectrum) -> float:
    """Lowest frequency of a beat slower than the rows on which most timestamps lie; 0 where there is none."""
    a, b = int(POLLED / spectrum.width), int(SLOWER / spectrum.width) - spectrum.lobe
    inside = spectrum.power[int(SLOWER / spectrum.width) : int(HIGHEST / spectrum.width)]
    strong = np.flatnonzero(spectrum.power[a:b] > max(0.5, 0.9 * float(inside.max()))) if b > a else np.zeros(0)
    if not len(strong):
        return 0.0
    k = a + int(strong[0])
    k += int(np.argmax(spectrum.power[k : k + 2 * spectrum.lobe]))
    return _summit(spectrum.power, k) * spectrum.width


def _choose(spectrum: _Spectrum, line: float, rows: float, apart: float) -> float | None:
    """The period's frequency per mean distance of rows, or ``None`` where none is significant; ``rows`` of a packet, on
    average, and how far most packets are ``apart``, in mean distances."""
    peaks = spectrum.peaks()
    power, per_step = spectrum.power[peaks], spectrum.per_step[peaks]
    near = 2 * spectrum.lobe * spectrum.width
    multiple = np.rint(per_step / line) if line else np.zeros(len(peaks))
    is_line = (multiple > 0) & (np.abs(per_step - multiple * line) < near)
    poll = _poll(spectrum) if not line else 0.0
    if poll:
        # The log is written at this beat, which is too slow for the sensor; its multiples are not the period either.
        line = poll
        multiple = np.rint(per_step / poll)
        is_line = np.abs(per_step - multiple * poll) < 2.0 * near * multiple
    free, strength = per_step[~is_line], power[~is_line]
    chosen: float | None = None
    # A period with many lost samples needs a high power.
    plain = (_cost(free) < MANY) | (strength > PLAIN)
    free, strength = free[plain], strength[plain]
    if len(free):
        strong = free[strength >= 0.4 * strength.max()]
        chosen = float(strong[np.argmin(_cost(strong))])
    if not line or line > HIGHEST:
        return chosen
    whole = max(round(rows), 1)
    if line < SLOWER:
        # Packets with a whole number of samples; else a coarse grid, on which the period is a weaker peak or none.
        is_packet = not poll and abs(rows - whole) < WHOLE * whole
        return whole * line / max(round(apart * line), 1) if is_packet else chosen
    # An exact log has only its own line; on a grid close to the period, the period has fewer lost samples. A log with
    # every tenth sample lost looks like one with a grid of nine tenths of the period: a loss is more common.
    loses_fewer = chosen is not None and _cost(np.array([line]))[0] > max(_cost(np.array([chosen]))[0], REGULAR)
    return chosen if loses_fewer else line


def _cost(per_step: FloatArray) -> FloatArray:
    """Share of samples lost with a period; more rows than periods weigh 8 times, because nothing causes them."""
    excess = per_step - 1.0
    return np.where(excess >= 0.0, excess, 8.0 * np.maximum(-excess - 0.003, 0.0))


def _summit(power: FloatArray, k: int) -> float:
    """Position (fractional index) of the maximum of a parabola through the points k - 1, k, k + 1."""
    if not 0 < k < len(power) - 1:
        return float(k)
    left, mid, right = power[k - 1], power[k], power[k + 1]
    bend = left - 2.0 * mid + right
    return float(k + (0.5 * (left - right) / bend if bend < 0 else 0.0))
