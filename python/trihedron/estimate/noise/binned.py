"""The spectrum in narrow bins, its most likely noise terms, and a Gauss-Markov process where they may not suffice."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.channel_facts.low_pass import RISE
from trihedron.errors import InputError
from trihedron.estimate.noise.slow_changes import PLAUSIBLE
from trihedron.estimate.noise.spectrum import SYMBOLS, Ordinates, gauss_markov_density
from trihedron.records.noise import LEAST_S

EVIDENCE = 8.0
"""Cost of a parameter in the choice between B, K and a Gauss-Markov process (size and time). An absent term reaches
it with a probability of 0.25 % (half a chi-square with one degree of freedom)."""
SLOW_TERMS = (2, 3)
"""The terms that the process may replace: B and K."""
DROPPED = (frozenset[int](), *(frozenset({k}) for k in SLOW_TERMS), frozenset(SLOW_TERMS))

TOLERANCE_GAUSS_MARKOV = 0.02
"""Relative uncertainty of a half octave in the search for a Gauss-Markov process."""

UNLIKELY = 4.0
"""Deviation of a half octave, or of the sum of a run, in standard errors, that chance explains once in 100 logs of 20
octaves."""
RUNS = (1, 2, 4, 8)
"""Half octaves in a run: a decade at most, over which flicker and a walk part by as much."""

BIN_WIDTH = 1.025
"""Ratio of the edges of a bin: the density of a random walk varies by 5 % inside it, and its mean is used."""


Range = tuple[float, float]
"""Frequencies [Hz] from the lower to the upper."""


@dataclass(frozen=True, eq=False)
class BinnedSpectrum:
    """Ordinates averaged over narrow bins: all (b,), ``basis`` (terms, b), ``cross`` (c, b) and ``square`` (c, c, b) of
    the columns, the line first, then those of slow changes."""

    frequency_hz: FloatArray
    count: FloatArray
    power: FloatArray
    cross: FloatArray
    square: FloatArray
    basis: FloatArray

    def with_gauss_markov(self, step_s: float, correlation_time_s: float) -> BinnedSpectrum:
        """The bins with a unit Gauss-Markov process as a fifth term."""
        row = gauss_markov_density(self.frequency_hz, step_s, correlation_time_s)
        return replace(self, basis=np.vstack([self.basis, row]))

    def capped(self, tolerance: float) -> BinnedSpectrum:
        """The bins with counts reduced so that no half octave has a relative uncertainty below ``tolerance``."""
        key = np.floor(2.0 * np.log2(self.frequency_hz / self.frequency_hz[0])).astype(np.int64)
        total = np.bincount(key, weights=self.count)
        return replace(self, count=self.count * np.minimum(1.0, 2.0 / tolerance**2 / total[key]))

    @cached_property
    def likelihood(self) -> _core.SpectralBins:
        """The likelihood of these bins."""
        return _core.SpectralBins(self.count, self.power, self.cross, self.square, self.basis)

    @cached_property
    def fit(self) -> _core.SpectralFit:
        """The most likely strengths of all terms, the columns integrated out."""
        return self.likelihood.fit(range(len(self.basis)))

    def ratio(self, fit: _core.SpectralFit | None = None) -> FloatArray:
        """(b,) power after subtraction of the columns over its expectation by ``fit``, its own by default."""
        fit = self.fit if fit is None else fit
        s = np.asarray(fit.columns)
        power = self.power - 2.0 * s @ self.cross + np.einsum("i,j,ijb->b", s, s, self.square)
        return np.asarray(power / (np.asarray(fit.strength) @ self.basis))

    def below(self, highest_hz: float) -> BinnedSpectrum:
        """The bins up to ``highest_hz``."""
        low = self.frequency_hz <= highest_hz
        return BinnedSpectrum(*(getattr(self, one.name)[..., low] for one in fields(self)))

    def tempered(self) -> tuple[BinnedSpectrum, float, tuple[float, float] | None]:
        """The bins with less weight on half octaves, or runs of them, that the terms do not explain: z² of their sum as
        variance factor (Birge ratio). A spectrum that bends where the terms do not leaves them for octaves by little.

        Also the largest factor, and the worst mean deviation of the power, with its frequency, where it exceeds 10 %.
        """
        octaves = np.log2(self.frequency_hz / self.frequency_hz[0])
        group = np.unique(np.floor(2.0 * octaves), return_inverse=True)[1]
        n = np.bincount(group, self.count)
        ratio, frequency = (np.bincount(group, self.count * of) / n for of in (self.ratio(), self.frequency_hz))
        # Cube root: nearly normal for few degrees of freedom (Wilson-Hilferty).
        z = (np.maximum(ratio, 0.0) ** (1 / 3) - (1 - 2 / (9 * n))) / np.sqrt(2 / (9 * n))
        factor, worst = np.ones(len(z)), (0.0, 0.0)
        for width in (width for width in RUNS if width <= len(z)):
            mean = np.ones(width) / width
            far, deviation, at = (np.convolve(of, mean, "valid") for of in (z, ratio - 1.0, frequency))
            for k in np.flatnonzero(np.abs(far) > UNLIKELY / math.sqrt(width)):
                factor[k : k + width] = np.maximum(factor[k : k + width], width * far[k] ** 2)
                worst = max(worst, (float(deviation[k]), float(at[k])), key=lambda one: abs(one[0]))
        return (
            replace(self, count=self.count / factor[group]),
            float(factor.max()),
            worst if abs(worst[0]) > 0.1 else None,
        )


def within(bands: Sequence[Ordinates], ranges: Sequence[Range]) -> list[BoolArray]:
    """Masks of the ordinates of each band that lie in ``ranges`` of frequency [Hz]."""
    masks = [np.zeros(len(band.frequency_hz), dtype=bool) for band in bands]
    for band, mask in zip(bands, masks, strict=True):
        for low_hz, high_hz in ranges:
            mask[np.searchsorted(band.frequency_hz, low_hz) : np.searchsorted(band.frequency_hz, high_hz, "right")] = (
                True
            )
    return masks


def binned(bands: Sequence[Ordinates], highest_hz: float, masked: Sequence[BoolArray]) -> BinnedSpectrum:
    """Ordinates up to ``highest_hz`` that are not ``masked``, averaged in bins of ``BIN_WIDTH``."""
    pick = [(band.frequency_hz <= highest_hz) & ~mask for band, mask in zip(bands, masked, strict=True)]
    frequency = np.concatenate([band.frequency_hz[p] for band, p in zip(bands, pick, strict=True)])
    if len(frequency) == 0:
        lasts_s = max(band.length * band.step_s for band in bands)
        raise InputError(
            f"{lasts_s:.3g} s are too short: low-pass filter and periodic lines leave nothing of the spectrum for "
            f"noise terms; record {LEAST_S if lasts_s < LEAST_S else 4.0 * lasts_s:.0f} s or more, an hour is useful"
        )
    order = np.argsort(frequency, kind="stable")

    def gather(of_band: Callable[[Ordinates], FloatArray]) -> FloatArray:
        parts = [of_band(band)[..., p] for band, p in zip(bands, pick, strict=True)]
        return np.asarray(np.concatenate(parts, axis=-1)[..., order])

    frequency, count = frequency[order], gather(lambda band: band.count)
    key = np.floor(np.log(frequency / frequency[0]) / np.log(BIN_WIDTH))
    edges = np.flatnonzero(np.concatenate([[True], np.diff(key) > 0]))
    total = np.add.reduceat(count, edges)

    def averaged(of_band: Callable[[Ordinates], FloatArray]) -> FloatArray:
        return np.asarray(np.add.reduceat(gather(of_band) * count, edges, axis=-1) / total)

    return BinnedSpectrum(
        frequency_hz=averaged(lambda band: band.frequency_hz),
        count=total,
        power=averaged(lambda band: band.power),
        cross=averaged(lambda band: band.cross),
        square=averaged(lambda band: band.columns[:, np.newaxis] * band.columns),
        basis=averaged(lambda band: band.basis),
    )


@dataclass(frozen=True, eq=False)
class Model:
    """A spectrum with its terms and, perhaps, a Gauss-Markov process as the last.

    ``evidence`` is what the process reduces the deviance by beyond the slow terms that it replaces; ``beside`` are the
    other likely correlation times, each with the ``rise`` of the deviance above that of the most likely one.
    """

    spectrum: BinnedSpectrum
    correlation_time_s: float | None = None
    evidence: float = 0.0
    rise: float = 0.0
    beside: tuple[Model, ...] = ()

    def power(self, band: Ordinates, step_s: float) -> FloatArray:
        """(k,) expected power of every ordinate of ``band``; readings are ``step_s`` apart."""
        strength = np.asarray(self.spectrum.fit.strength)
        out = strength[: len(SYMBOLS)] @ band.basis
        if self.correlation_time_s is not None:
            out = out + strength[-1] * gauss_markov_density(band.frequency_hz, step_s, self.correlation_time_s)
        return np.asarray(out)


def models_of(
    bands: Sequence[Ordinates],
    highest_hz: float,
    affected: Sequence[Range] = (),
    *,
    tolerance: float = 0.0,
) -> list[Model]:
    """The models of the ordinates up to ``highest_hz`` outside the ranges that lines have ``affected``, the one that is
    stated first.

    Raises ``InputError`` when the channel does not change, or no ordinate of the spectrum remains.
    """
    masked = within(bands, affected)
    spectrum = binned(bands, highest_hz, masked)
    cornered = _cornered(bands, spectrum.fit.strength)
    if any(c.any() for c in cornered):
        spectrum = binned(bands, highest_hz, [c | m for c, m in zip(cornered, masked, strict=True)])
    if tolerance > 0.0:
        spectrum = spectrum.capped(tolerance)
    return models_of_bins(min(band.step_s / band.block for band in bands), spectrum)


def _cornered(bands: Sequence[Ordinates], strength: Sequence[float]) -> list[BoolArray]:
    """Masks of ordinates that the unpaired first and last phase of quantisation affect: these are correlated.

    The first ordinate of a band is not masked: alone it has no correlation, and it is where a ramp shows.
    """
    out = []
    for band in bands:
        expectation = np.asarray(strength) @ band.basis
        # Two random values common to hundreds of ordinates would look like a ramp.
        out.append((strength[0] * band.corner_floor > 0.002 * expectation) & (band.order > 1))
    return out


def models_of_bins(step_s: float, spectrum: BinnedSpectrum) -> list[Model]:
    """The spectrum without a Gauss-Markov process, with one, or both where either may be."""
    # Filters change a spectrum by a few per cent: a process must be significant beyond this tolerance.
    capped, frequency = spectrum.capped(TOLERANCE_GAUSS_MARKOV), spectrum.frequency_hz
    # With a shorter time constant the process is white in this log, with a longer one a random walk.
    shortest, longest = 1.0 / (2 * np.pi * frequency[-1]), 1.0 / (2 * np.pi * frequency[0])
    without = Model(spectrum)
    if not longest > 64 * shortest:
        return [without]

    def deviances(likelihood: _core.SpectralBins, process: Sequence[int] = ()) -> FloatArray:
        """(4,) with all terms, without each of the slow ones, and without both."""
        found: dict[frozenset[int], _core.SpectralFit] = {}
        for dropped in DROPPED:
            # Without a term that is zero where others are dropped the fit is the same.
            same = (fit for less, fit in found.items() if less < dropped and not any(fit.strength[k] for k in dropped))
            terms = (k for k in range(len(SYMBOLS)) if k not in dropped)
            found[dropped] = next(same, None) or likelihood.fit([*terms, *process])
        return np.array([fit.deviance for fit in found.values()])

    plain, n_active = deviances(capped.likelihood), np.array([len(SYMBOLS) - len(dropped) for dropped in DROPPED])

    def gains(times_s: FloatArray, prices: Sequence[float] = (EVIDENCE,)) -> FloatArray:
        """(prices, times) decrease of the deviance by a process beyond that of terms at each price."""
        beside = [deviances(capped.with_gauss_markov(step_s, time_s).likelihood, (len(SYMBOLS),)) for time_s in times_s]
        costs = np.multiply.outer(prices, n_active)[:, np.newaxis]
        return np.asarray((plain + costs).min(axis=2) - (np.array(beside) + costs).min(axis=2))

    # A corner in the uppermost three octaves is that of a filter, not of a process of the sensor.
    grid = np.geomspace(8 * shortest, longest / 2, max(4, int(np.log2(longest / shortest)) - 3))
    coarse = gains(grid)[0]
    if coarse.max() < EVIDENCE:
        return [without]
    best, step = grid[coarse.argmax()], grid[1] / grid[0]
    times = np.geomspace(max(best / step, grid[0]), best * step, N_TIMES)
    gain, likely = gains(times, (EVIDENCE, PLAUSIBLE))
    most = float(gain.max())
    if most < 2.0 * EVIDENCE and likely.max() < 2.0 * PLAUSIBLE:
        return [without]
    process = replace(_at_likely_times(spectrum, step_s, times), evidence=most)
    return [process] if most >= 2.0 * EVIDENCE else [without, process]


N_TIMES = 17
"""Correlation times tried at once."""
LEAST_TIMES = 5
"""Fewest of them that are to be likely: intervals reach over these."""


def _at_likely_times(spectrum: BinnedSpectrum, step_s: float, times: FloatArray) -> Model:
    """The spectrum with a process at the most likely of ``times`` (or between them), and at the other likely ones."""
    while True:
        at = [spectrum.with_gauss_markov(step_s, time_s) for time_s in times]
        deviance = np.array([one.fit.deviance for one in at])
        k = int(deviance.argmin())
        rise = deviance - deviance[k]
        likely = np.flatnonzero(rise < RISE)
        if len(likely) >= LEAST_TIMES or times[-1] < 1.001 * times[0]:
            break
        times = np.geomspace(times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)], N_TIMES)
    tried = likely[np.unique(np.linspace(0, len(likely) - 1, LEAST_TIMES).round().astype(int))]
    beside = tuple(Model(at[i], float(times[i]), rise=float(rise[i])) for i in tried if i != k)
    return Model(at[k], float(times[k]), beside=beside)
