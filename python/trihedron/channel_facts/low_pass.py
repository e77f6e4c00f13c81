"""The low-pass of a sensor in the spectra of its static axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.records.channel_facts import LowPass
from trihedron.records.pose_noise import Measured

EARNED = 16.0
"""Decrease of the deviance that a corner requires: it is searched over a grid and five shapes."""
RISE = 4.6
"""Rise of the deviance at the ends of a 95 % interval. For χ² with one degree of freedom it is 3.84, which covers only
92 to 94 % with other terms at their bound 0 (docs/noise.md, 3)."""
TOLERANCE = 0.03
"""Relative error of every band of the spectrum, at least: noise is not exactly flat, nor a filter exactly a shape."""
SHAPE = 0.05
"""Log ratio of the -3 dB frequency of two to four cascaded running means to that of the nearest shape (4 %), by which
the interval is widened. For a filter that peaks, or with equal poles, it can be a third."""
ORDERS = (1, 2, 3, 4)
"""Orders of Butterworth filters; also a Gaussian, the limit of cascaded running means (CIC), is tried."""
FLICKER_AND_WALK = (1, 2)
LEAKAGE = (4, 8)
"""Powers of frequency above ringing that is cut off: its resonance falls with the fourth power, faster next to it."""
FINE = 16
"""Lowest ordinates that stay single; above, neighbours within ``WIDTH`` of their frequency are averaged."""
WIDTH = 0.04
LEAST_GAIN = 1e-9
"""Least gain: that of a Gaussian far above its corner underflows."""
HUMP = 0.25
"""Half-width around a line, in the logarithm: a resonance of quality 2 has fallen to half there."""
FINER = 8
"""Corners tried on either side of the best of the grid, up to its neighbours."""
SAME = 1e-9
HIGHEST_FLOOR = 0.125
"""Of the rate: at most a quarter of the spectrum below Nyquist may be excluded as disturbance."""
MODEL_PARAMETERS = 5
MISFIT = 3.0
"""Standard deviations of the deviance above which a spectrum contains more than filtered noise, flicker and walk."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Mean power (k,) at frequencies (k,) of ``count`` segments of one axis, two-sided densities.

    ``rounding`` is the density of the rounding, ``scatter`` that of the poses' power;
    ``slow`` are the powers of 1/f of slow noise: flicker and walk, or leakage from below where that was cut off.
    """

    frequency_hz: FloatArray
    power: FloatArray
    count: int
    rounding: float
    scatter: float
    slow: tuple[int, ...] = FLICKER_AND_WALK

    @cached_property
    def bins(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Frequency, mean power and number of ordinates, times segments, of each bin."""
        n = len(self.power)
        edges = [*range(min(FINE, n))]
        while edges[-1] < n:
            edges.append(edges[-1] + max(1, int(WIDTH * edges[-1])))
        starts = np.array([e for e in edges if e < n])
        size = np.diff([*starts.tolist(), n]).astype(np.float64)
        frequency = np.add.reduceat(self.frequency_hz, starts) / size
        return frequency, np.add.reduceat(self.power, starts) / size, size * self.count

    def above(self, lowest_hz: float) -> Spectrum:
        """The part at and above a frequency; all of it for zero."""
        if lowest_hz == 0.0:
            return self
        high = self.frequency_hz >= lowest_hz
        return replace(self, frequency_hz=self.frequency_hz[high], power=self.power[high], slow=LEAKAGE)

    def beside(self, lines_hz: Sequence[float]) -> Spectrum:
        """The spectrum without the neighbourhood of lines, where a stand or a hand rings."""
        near = np.zeros(len(self.frequency_hz), dtype=bool)
        for line in lines_hz:
            near |= np.abs(np.log(self.frequency_hz / line)) < HUMP
        # Where lines are everywhere, no other part remains.
        if 2 * np.count_nonzero(near) > len(near):
            return self
        return replace(self, frequency_hz=self.frequency_hz[~near], power=self.power[~near])

    def beneath(self, frequency_hz: FloatArray) -> FloatArray:
        """(k, terms) shapes of slow noise at ``frequency_hz`` (k,), 1 at the lowest frequency of the spectrum."""
        return np.stack([(self.frequency_hz[0] / frequency_hz) ** power for power in self.slow], axis=1)

    def weights(self, axes: int) -> FloatArray:
        """Weight of each bin: its ordinates, limited by the error of the model's shape, which all ``axes`` share."""
        _, _, count = self.bins
        # An eighth of the spectrum weighs no more than the tolerance and the scatter of poses allow.
        error = TOLERANCE**2 * axes + self.scatter**2 / max(self.count, 1)
        cap = 2.0 / error / (len(self.power) / 8.0)
        return np.minimum(count, cap * count / self.count)

    @property
    def rounding_share(self) -> float:
        """Rounding over the level of the lower quarter of the spectrum."""
        frequency, power, _ = self.bins
        low = power[frequency <= 0.25 * frequency[-1]]
        level = float(np.median(low)) if len(low) else 0.0
        return min(self.rounding / level, 1.0) if level > 0.0 else 1.0


def low_passes(spectra: Sequence[Spectrum], rate_hz: float) -> list[LowPass]:
    """The filter of each axis of a sensor: one for all where no axis contradicts it.

    The model of an axis is filtered white noise, flicker and walk, and unfiltered rounding, from the lowest frequency
    on above which it fits: a stand that rings after every rotation is no filter.
    """
    grid = corners_tried(spectra, rate_hz)
    tables = [_deviances(s, grid, rate_hz, len(spectra)) for s in spectra]
    together = np.sum([table for table, _ in tables], axis=0)
    flat = sum(flat for _, flat in tables)
    place = np.unravel_index(int(np.argmin(together)), together.shape)
    if flat - together[place] > EARNED:
        against = max(min(float(table[place]), own_flat) - float(table.min()) for table, own_flat in tables)
    else:
        against = max(own_flat - float(table.min()) for table, own_flat in tables)

    def settled(of: Sequence[Spectrum], table: FloatArray, without: float) -> LowPass:
        around = _around(grid, table)
        finer = np.sum([_deviances(s, around, rate_hz, len(spectra))[0] for s in of], axis=0)
        order = np.argsort(corners := np.concatenate([grid, around]))
        return _settled(np.hstack([table, finer])[:, order], without, corners[order])

    if against <= EARNED:
        return [settled(spectra, together, flat)] * len(spectra)
    return [settled([s], table, own_flat) for s, (table, own_flat) in zip(spectra, tables, strict=True)]


def corners_tried(spectra: Sequence[Spectrum], rate_hz: float) -> FloatArray:
    """Corners [Hz] from four periods per segment, or a 64th of Nyquist, to four times Nyquist."""
    floor = max((4.0 * float(s.frequency_hz[0]) for s in spectra), default=0.0)
    return np.geomspace(max(rate_hz / 128.0, floor), 2.0 * rate_hz, 49)


def undisturbed(spectrum: Spectrum, rate_hz: float) -> Spectrum:
    """The spectrum from the lowest octave on above which filter, flicker and walk explain it; all of it, if none does.

    Disturbances that ring, a swaying stand and a trembling hand fill the lowest octaves of many poses, and only those.
    """
    grid = corners_tried([spectrum], rate_hz)[::2]
    lowest = 0.0
    while lowest < HIGHEST_FLOOR * rate_hz:
        above = spectrum.above(lowest)
        _, power, _ = above.bins
        weight = above.weights(1)
        if not np.all(power > 0.0) or len(power) < FINE:
            return spectrum
        table, flat = _deviances(above, grid, rate_hz, 1)
        misfit = min(float(table.min()), flat) - float(weight @ (np.log(power) + 1.0))
        free = len(power) - MODEL_PARAMETERS
        if misfit < free + MISFIT * math.sqrt(2.0 * free):
            return above
        lowest = 2.0 * lowest if lowest > 0.0 else 2.0 * float(spectrum.frequency_hz[0])
    return spectrum


def _deviances(spectrum: Spectrum, grid: FloatArray, rate_hz: float, axes: int) -> tuple[FloatArray, float]:
    """Deviance of every shape and corner (shapes, corners), and without a filter."""
    frequency, power, _ = spectrum.bins
    weight = spectrum.weights(axes)
    cross, square = np.zeros((0, len(power))), np.zeros((0, 0, len(power)))
    share = spectrum.rounding_share
    slow = spectrum.beneath(frequency).T
    terms = list(range(1 + len(slow)))

    def deviance(gain: FloatArray) -> float:
        basis = np.vstack([(1.0 - share) * gain + share, slow])
        return float(_core.SpectralBins(weight, power, cross, square, basis).fit(terms).deviance)

    if not np.any(power > 0.0):
        return np.zeros((len(ORDERS) + 1, len(grid))), 0.0
    tried = _gains(frequency.tobytes(), grid.tobytes(), rate_hz)
    return np.array([[deviance(gain) for gain in of_shape] for of_shape in tried]), deviance(np.ones(len(power)))


@lru_cache(maxsize=8)
def _gains(frequency_hz: bytes, corners_hz: bytes, rate_hz: float) -> FloatArray:
    """Gains (shapes, corners, bins) of all filters tried; cached, as the axes and logs of a sensor share them."""
    frequency, corners = np.frombuffer(frequency_hz), np.frombuffer(corners_hz)
    return np.array([[gain_of(frequency, float(c), shape, rate_hz) for c in corners] for shape in (0, *ORDERS)])


def _around(grid: FloatArray, table: FloatArray) -> FloatArray:
    """Corners between the best of the grid and its neighbours, whose distance exceeds the uncertainty of a corner."""
    place = int(np.argmin(table.min(axis=0)))
    ends = grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)]
    fine = np.geomspace(*ends, 2 * FINER + 1)
    known = grid[max(place - 1, 0) : place + 2]
    return fine[np.all(np.abs(fine[:, np.newaxis] / known - 1.0) > SAME, axis=1)]


def _settled(table: FloatArray, flat: float, grid: FloatArray) -> LowPass:
    best = table.min(axis=0)
    rise = best - (min(float(best.min()), flat) + RISE)
    inside = np.flatnonzero(rise <= 0.0)
    place = int(np.argmin(best))
    if flat - best[place] < EARNED:
        return LowPass(None, float(grid[inside[0]]) if len(inside) else float(grid[-1]))
    lower, upper = _crossing(grid, rise, int(inside[0]), -1), _crossing(grid, rise, int(inside[-1]), 1)
    lower, upper = lower * math.exp(-SHAPE), upper * math.exp(SHAPE)
    sigma = math.log(upper / lower) / (2.0 * math.sqrt(RISE))
    shape = (0, *ORDERS)[int(np.argmin(table[:, place]))]
    return LowPass(Measured(float(grid[place]), lower, upper, sigma), lower, shape)


def _crossing(grid: FloatArray, rise: FloatArray, last: int, step: int) -> float:
    """Corner where the deviance crosses its limit beyond the ``last`` corner inside, by interpolation."""
    beyond = last + step
    if not 0 <= beyond < len(grid):
        return float(grid[last])
    part = rise[last] / (rise[last] - rise[beyond])
    return float(grid[last] * (grid[beyond] / grid[last]) ** part)


def gain_of(frequency_hz: FloatArray, corner_hz: float, shape: int, rate_hz: float) -> FloatArray:
    """Power gain of a filter before sampling, with aliasing from above Nyquist; 1 at zero frequency.

    Butterworth of order ``shape``, Gaussian for 0; -3 dB at ``corner_hz``.
    """
    fold: FloatArray = rate_hz * np.arange(-8.0, 9.0)

    def unfolded(f: FloatArray) -> FloatArray:
        square = (f / corner_hz) ** 2
        return np.asarray(np.exp(-math.log(2.0) * square) if shape == 0 else 1.0 / (1.0 + square**shape))

    gain = np.sum(unfolded(np.asarray(frequency_hz[:, np.newaxis] + fold)), axis=1) / np.sum(unfolded(fold))
    return np.asarray(np.maximum(gain, LEAST_GAIN))
