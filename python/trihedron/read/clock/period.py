"""The sampling period from timestamps alone, before losses are counted: a peak of a phase sum (docs/reading.md, 4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.probability import chdtri
from trihedron.quantiles import quantile

WINDOW = 2048
"""Rows of one phase sum: a rate that wanders by 10⁻⁴ within it turns the phase by a fifth of a period."""
MOST_WINDOWS = 10
LOWEST, HIGHEST = 0.8, 1.9
"""Periods looked for, as parts of the rows' mean distance: up to 45 % of all samples may be lost."""
GRID_HIGHEST = 16.0
"""A grid of timestamps finer than this part of a period is no matter."""
LINE, LINE_HELD = 0.98, 0.9
"""Power of a phase sum, and of that of its eighth multiple, above which all timestamps lie on multiples of one step."""
LEAST = 1e-4
"""Power below which nothing is a peak."""
CHANCE = 1e-7
"""Chance of noise to pass for a period at one frequency looked at (some 10⁴ of them). Steps drawn anew, without a clock
behind them, leave a hump as high as a line, but wide: what a line is held against lies beside it."""
SLOWER = 0.985
"""A beat with fewer ticks than the log has rows is no period; there is room for the error of counting."""
ALIASED, COARSE_COHERENCE = 0.75, 0.15
"""On a beat slower than the first, aliases of beat and period lie among the periods looked for, as high as the period
itself if its phase sum is shorter than the second."""
MANY, PLAIN = 0.15, 0.25
"""A period by which more than this share of samples is lost needs a power of its phase sum above the second."""
FEWEST_TIMESTAMPS = 100
"""Distinct timestamps that a period needs."""
WHOLE = 0.005
"""A packet holds a whole number of samples if the rows come this near to it."""
POLLED = 0.55
"""Slower beats than this may be packets of two and more samples, whose multiples hold the period."""
REGULAR = 0.12
"""Share of samples that may be lost with regularity before a coarse grid is the likelier cause."""
PAUSE_STEPS = 50.0
"""A step longer than this many is a pause of the logger, not a loss to be counted."""


@dataclass(frozen=True)
class Period:
    """``period_s``; ``coherence`` the length of its phase sum (1: timestamps exactly even, 0: none seen); ``grid_s``
    the step on whose multiples all timestamps lie, or 0. ``is_seen``: the period stands out: losses can be counted."""

    period_s: float
    coherence: float
    grid_s: float
    is_seen: bool


def find_period(time_s: FloatArray) -> Period:
    """Period of timestamps (n,) in order; at least 64 rows.

    ``|mean exp(2πi t/T)|²`` is averaged over windows of 2048 rows. Samples lost by whole periods leave its peak where
    it is; a delay d lowers it to ``|E exp(2πi d/T)|²``. Where several periods explain the timestamps alike (batches,
    coarse grids) the one that loses fewest samples is taken.
    """
    windows, mean_step = _windows(time_s)
    cell = mean_step / (2.0 * GRID_HIGHEST)
    size = max(float(w[-1]) for w in windows) / cell
    power, length = _core.phase_power(windows, cell, int(4 * size) + 16)
    threshold = chdtri(2 * len(windows), CHANCE) / chdtri(2 * len(windows), 0.5)
    spectrum = _Spectrum(power, mean_step / (length * cell), int(2 * length / size) + 1, threshold)
    line = _first_line(windows, mean_step, spectrum)
    grid = mean_step / line if line else 0.0
    # A step that only one in 500 falls short of.
    shortest = quantile(np.concatenate([np.diff(w) for w in windows]), 0.002)
    best = _choose(spectrum, line, shortest / mean_step)
    if best is None or sum(np.count_nonzero(np.diff(w) > 0.2 * mean_step) for w in windows) < FEWEST_TIMESTAMPS:
        return Period(mean_step, 0.0, grid, False)
    k = int(np.argmin(np.abs(spectrum.per_step - best)))
    reach = spectrum.lobe
    k = int(np.argmax(power[k - reach : k + reach + 1])) + k - reach
    period = mean_step / (_summit(power, k) * spectrum.width)
    if grid and abs(grid - period) < 0.02 * grid:
        grid = 0.0  # the period itself
    return Period(period, float(np.sqrt(power[k])), grid, True)


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """``power`` on multiples of ``width`` periods per mean distance of rows; ``lobe`` half-width of a line in points;
    ``threshold`` medians of what lies beside it that a line exceeds."""

    power: FloatArray
    width: float
    lobe: int
    threshold: float

    @cached_property
    def per_step(self) -> FloatArray:
        """Frequency of every point."""
        return np.asarray(self.width * np.arange(len(self.power)))

    def peaks(self) -> IntArray:
        """Points inside the range of periods that stand out sharply from what is beside them."""
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
    """Lowest frequency (per mean distance of rows) on whose multiples all timestamps lie; 0 where there is none."""
    per_step = spectrum.per_step
    high = np.flatnonzero((spectrum.power > 0.9 * LINE) & (per_step >= 0.05) & (per_step <= GRID_HIGHEST))
    while len(high):
        group = high[: int(np.searchsorted(high, high[0] + 2 * spectrum.lobe))]
        k = int(group[np.argmax(spectrum.power[group])])
        f = _summit(spectrum.power, k) * spectrum.width
        # The multiple of a rough frequency misses by as many times: its own neighbourhood is looked through.
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
    out: FloatArray = np.mean([_direct(w, frequency_hz) for w in windows], axis=0)
    return out


def _direct(time_s: FloatArray, frequency_hz: FloatArray) -> FloatArray:
    """Power of the phase sum of the first timestamps at every frequency (k,), evenly spaced."""
    first, step = float(frequency_hz[0]), float(frequency_hz[1] - frequency_hz[0])
    return _core.direct_power(time_s[:512], first, step, len(frequency_hz))


def _windows(time_s: FloatArray) -> tuple[list[FloatArray], float]:
    """Stretches of the log without a pause, each from its own bias, and the mean distance of rows."""
    n = len(time_s)
    width = min(WINDOW, n)
    # `np.unique` would load masked arrays.
    starts = sorted(set(np.linspace(0, n - width, min(max(n // width, 1), MOST_WINDOWS)).astype(np.int64).tolist()))
    usual = float(np.median([(time_s[s + width - 1] - time_s[s]) / (width - 1) for s in starts]))
    kept: list[FloatArray] = []
    for s in starts:
        w = time_s[s : s + width]
        cuts = np.concatenate([[0], np.flatnonzero(np.diff(w) > PAUSE_STEPS * usual) + 1, [width]])
        longest = int(np.argmax(np.diff(cuts)))
        piece = w[cuts[longest] : cuts[longest + 1]]
        if len(piece) >= min(64, width // 2) and piece[-1] > piece[0]:
            kept.append(piece - piece[0])
    if not kept:
        kept = [time_s - time_s[0]]
    steps = [float(w[-1]) / (len(w) - 1) for w in kept]
    # Losses lengthen it, a stall at an end shortens it: the lower quartile is near the window with the fewest.
    return kept, quantile(np.array(steps), 0.25)


def _poll(spectrum: _Spectrum) -> float:
    """Lowest frequency of a beat slower than the rows that most timestamps keep to; 0 where there is none."""
    a, b = int(POLLED / spectrum.width), int(SLOWER / spectrum.width) - spectrum.lobe
    inside = spectrum.power[int(SLOWER / spectrum.width) : int(HIGHEST / spectrum.width)]
    strong = np.flatnonzero(spectrum.power[a:b] > max(0.5, 0.9 * float(inside.max()))) if b > a else np.zeros(0)
    if not len(strong):
        return 0.0
    k = a + int(strong[0])
    k += int(np.argmax(spectrum.power[k : k + 2 * spectrum.lobe]))
    return _summit(spectrum.power, k) * spectrum.width


def _choose(spectrum: _Spectrum, line: float, shortest: float) -> float | None:
    """The period's frequency per mean distance of rows, or ``None`` where none stands out."""
    peaks = spectrum.peaks()
    if line > 0.0:
        # Rounding to a grid never makes a step shorter than the whole grid steps in a period: that tells an alias.
        in_period = np.floor(line / spectrum.per_step[peaks] + 0.02)
        peaks = peaks[(shortest * line > in_period - 0.5) | (in_period < 1)]
    power, per_step = spectrum.power[peaks], spectrum.per_step[peaks]
    near = 2 * spectrum.lobe * spectrum.width
    multiple = np.rint(per_step / line) if line else np.zeros(len(peaks))
    is_line = (multiple > 0) & (np.abs(per_step - multiple * line) < near)
    poll = _poll(spectrum) if not line else 0.0
    if poll:
        # A beat at which the log was written, too slow to be the sensor's: its multiples are not the period either.
        line = poll
        multiple = np.rint(per_step / poll)
        is_line = np.abs(per_step - multiple * poll) < 2.0 * near * multiple
    free, strength = per_step[~is_line], power[~is_line]
    chosen: float | None = None
    # A period that leaves many samples lost must be plain.
    plain = (_cost(free) < MANY) | (strength > PLAIN)
    free, strength = free[plain], strength[plain]
    if len(free):
        strong = free[strength >= 0.4 * strength.max()]
        chosen = float(strong[np.argmin(_cost(strong))])
    if not line or line > HIGHEST:
        return chosen
    of_line = line * max(round(1.0 / line), 1)
    if line < SLOWER:
        # Packets of a whole number of samples; else a coarse grid, on which the period is a weaker peak or none.
        if not poll and _cost(np.array([of_line]))[0] < WHOLE:
            return of_line
        clear = chosen is not None and (line > ALIASED or strength[free == chosen].max() > COARSE_COHERENCE**2)
        return chosen if clear else None
    # An exact log has its own line alone; on a grid about as wide as the period the period loses fewer samples. Every
    # tenth sample lost and a grid of nine tenths of the period look alike: the loss is the commoner.
    loses_fewer = chosen is not None and _cost(np.array([of_line]))[0] > max(_cost(np.array([chosen]))[0], REGULAR)
    return chosen if loses_fewer else of_line


def _cost(per_step: FloatArray) -> FloatArray:
    """Share of samples lost at a period; rows too many for it weigh more, since nothing makes them."""
    excess = per_step - 1.0
    return np.where(excess >= 0.0, excess, 8.0 * np.maximum(-excess - 0.003, 0.0))


def _summit(power: FloatArray, k: int) -> float:
    """Peak of a parabola through three points."""
    if not 0 < k < len(power) - 1:
        return float(k)
    left, mid, right = power[k - 1], power[k], power[k + 1]
    bend = left - 2.0 * mid + right
    return float(k + (0.5 * (left - right) / bend if bend < 0 else 0.0))
