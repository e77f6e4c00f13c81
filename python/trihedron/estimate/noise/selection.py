"""Selection of the noise terms of a spectrum: every subset is fitted, and each term has a penalty."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.errors import InputError
from trihedron.estimate.noise.spectrum import SYMBOLS, Ordinates, gauss_markov_density
from trihedron.records.noise import LEAST_S

EVIDENCE = 8.0
"""Penalty of a term: the least reduction of the deviance. An absent term reaches it with a probability of 0.25 % (half
a chi-square with one degree of freedom; the ramp, which has two signs, 0.5 %): four absent terms together 1.5 %."""

EVIDENCE_GAUSS_MARKOV = 16.0
"""Penalty of a Gauss-Markov process, whose time constant is searched on a grid."""

TOLERANCE_GAUSS_MARKOV = 0.02
"""Relative uncertainty of a half octave in the search for a Gauss-Markov process."""

BIN_WIDTH = 1.025
"""Ratio of the edges of a bin: the density of a random walk varies by 5 % inside it, and its mean is used."""


@dataclass(frozen=True, eq=False)
class BinnedSpectrum:
    """Ordinates averaged over narrow bins: all (b,), ``basis`` (terms, b)."""

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

    def likelihood(self) -> _core.SpectralBins:
        """The likelihood of these bins."""
        return _core.SpectralBins(self.count, self.power, self.cross, self.square, self.basis)

    def expectation(self, strength: npt.ArrayLike) -> FloatArray:
        """(b,) expected power for the strengths (squares) of the terms."""
        return np.asarray(np.asarray(strength) @ self.basis)

    def without_line(self, slope: float) -> FloatArray:
        """(b,) power after subtraction of a ramp of ``slope``."""
        return self.power - 2.0 * slope * self.cross + slope**2 * self.square


def binned(bands: Sequence[Ordinates], highest_hz: float, masked: Sequence[BoolArray] | None = None) -> BinnedSpectrum:
    """Ordinates up to ``highest_hz`` that are not ``masked``, averaged in bins of ``BIN_WIDTH``."""
    pick = [band.frequency_hz <= highest_hz for band in bands]
    if masked is not None:
        pick = [p & ~m for p, m in zip(pick, masked, strict=True)]
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
        square=averaged(lambda band: band.line**2),
        basis=averaged(lambda band: band.basis),
    )


@dataclass(frozen=True, eq=False)
class Selection:
    """The chosen model: ``active`` indices of the basis, whether it has a ramp, its fit, its spectrum."""

    active: tuple[int, ...]
    has_ramp: bool
    fit: _core.SpectralFit
    spectrum: BinnedSpectrum
    correlation_time_s: float | None = None
    evidence_gauss_markov: float = 0.0


def select(
    bands: Sequence[Ordinates],
    highest_hz: float,
    masked: Sequence[BoolArray] | None = None,
    *,
    tolerance: float = 0.0,
    is_cornered: bool = False,
) -> Selection:
    """The subset of {Q, N, B, K, R} of least deviance plus ``EVIDENCE`` per term, and a Gauss-Markov process if needed.

    Raises ``InputError`` when the channel does not change, or no ordinate of the spectrum remains.
    """
    spectrum = binned(bands, highest_hz, masked)
    if tolerance > 0.0:
        spectrum = spectrum.capped(tolerance)
    likelihood = spectrum.likelihood()
    table: dict[tuple[tuple[int, ...], bool], _core.SpectralFit] = {}
    for size in range(1, len(SYMBOLS) + 1):
        for active in combinations(range(len(SYMBOLS)), size):
            for has_ramp in (False, True):
                table[active, has_ramp] = likelihood.fit(active, has_ramp)

    def price(key: tuple[tuple[int, ...], bool]) -> float:
        return table[key].deviance + EVIDENCE * (len(key[0]) + key[1])

    best = min(table, key=price)
    if not is_cornered:
        cornered = _cornered(bands, table[best].strength)
        if any(c.any() for c in cornered):
            both = cornered if masked is None else [c | m for c, m in zip(cornered, masked, strict=True)]
            return select(bands, highest_hz, both, tolerance=tolerance, is_cornered=True)
    active, has_ramp = best
    plain = Selection(active, has_ramp, table[best], spectrum)
    step_s = min(band.step_s / band.block for band in bands)
    return _with_gauss_markov(step_s, plain) or plain


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


def _with_gauss_markov(step_s: float, plain: Selection) -> Selection | None:
    # Filters change a spectrum by a few per cent: a process must be significant beyond this tolerance.
    spectrum = plain.spectrum.capped(TOLERANCE_GAUSS_MARKOV)
    frequency = spectrum.frequency_hz
    price_plain = spectrum.likelihood().fit(plain.active, plain.has_ramp).deviance
    price_plain += EVIDENCE * (len(plain.active) + plain.has_ramp)
    # With a shorter time constant the process is white in this log, with a longer one a random walk.
    shortest, longest = 1.0 / (2 * np.pi * frequency[-1]), 1.0 / (2 * np.pi * frequency[0])
    extra = len(SYMBOLS)
    # The process is added to the selected terms, or replaces B, K or both.
    models = {(*(k for k in plain.active if k not in drop), extra) for drop in ((), (2,), (3,), (2, 3))}
    if not longest > 64 * shortest:
        return None

    def best_at(time_s: float) -> tuple[float, tuple[int, ...], bool]:
        likelihood = spectrum.with_gauss_markov(step_s, time_s).likelihood()
        found = []
        for model in models:
            deviance = likelihood.fit(model, plain.has_ramp).deviance
            price = deviance + EVIDENCE * (len(model) - 1 + plain.has_ramp) + EVIDENCE_GAUSS_MARKOV
            found.append((price, model, plain.has_ramp))
        return min(found)

    # A corner in the uppermost three octaves is that of a filter, not of a process of the sensor.
    grid = np.geomspace(8 * shortest, longest / 2, max(4, int(np.log2(longest / shortest)) - 3))
    coarse = [best_at(time_s)[0] for time_s in grid]
    place = int(np.argmin(coarse))
    if coarse[place] > price_plain + EVIDENCE_GAUSS_MARKOV / 2:
        return None
    step = grid[1] / grid[0]
    fine = np.geomspace(max(grid[place] / step, grid[0]), grid[place] * step, 17)
    finer = [best_at(time_s) for time_s in fine]
    place = int(np.argmin([item[0] for item in finer]))
    price, model, has_ramp = finer[place]
    if price > price_plain:
        return None
    time_s = float(fine[place])
    full = plain.spectrum.with_gauss_markov(step_s, time_s)
    fit = full.likelihood().fit(model, has_ramp)
    return Selection(
        active=model,
        has_ramp=has_ramp,
        fit=fit,
        spectrum=full,
        correlation_time_s=time_s,
        evidence_gauss_markov=price_plain - price + EVIDENCE_GAUSS_MARKOV,
    )
