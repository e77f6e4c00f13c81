"""All noise terms fitted to a spectrum together, and a Gauss-Markov process where it explains more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.errors import InputError
from trihedron.estimate.noise.spectrum import Ordinates
from trihedron.estimate.noise.terms import gauss_markov_density

EVIDENCE_GAUSS_MARKOV = 16.0
"""Least reduction of the deviance by a Gauss-Markov process, whose time constant is searched on a grid."""

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
        if tolerance == 0.0:
            return self
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
        raise InputError(f"no spectral ordinate lies below {highest_hz} Hz")
    order = np.argsort(frequency, kind="stable")

    def gather(parts: list[FloatArray]) -> FloatArray:
        return np.asarray(np.concatenate(parts, axis=-1)[..., order])

    frequency = frequency[order]
    count = gather([band.count[p] for band, p in zip(bands, pick, strict=True)])
    key = np.floor(np.log(frequency / frequency[0]) / np.log(BIN_WIDTH))
    edges = np.flatnonzero(np.concatenate([[True], np.diff(key) > 0]))
    total = np.add.reduceat(count, edges)

    def averaged(parts: list[FloatArray]) -> FloatArray:
        return np.asarray(np.add.reduceat(gather(parts) * count, edges, axis=-1) / total)

    chosen = list(zip(bands, pick, strict=True))
    return BinnedSpectrum(
        frequency_hz=averaged([band.frequency_hz[p] for band, p in chosen]),
        count=total,
        power=averaged([band.power[p] for band, p in chosen]),
        cross=averaged([band.cross[p] for band, p in chosen]),
        square=averaged([band.line[p] ** 2 for band, p in chosen]),
        basis=averaged([band.basis[:, p] for band, p in chosen]),
    )


@dataclass(frozen=True, eq=False)
class Selection:
    """All noise terms and a ramp fitted to a spectrum, with a Gauss-Markov process where it has a correlation time."""

    fit: _core.SpectralFit
    spectrum: BinnedSpectrum
    correlation_time_s: float | None = None
    evidence_gauss_markov: float = 0.0


def fitted(spectrum: BinnedSpectrum) -> _core.SpectralFit:
    """The most likely strengths of all terms in the basis, 0 where absent, and slope of the ramp."""
    return spectrum.likelihood().fit(range(len(spectrum.basis)), True)


def select(
    bands: Sequence[Ordinates], highest_hz: float, masked: Sequence[BoolArray] | None, tolerance: float
) -> Selection:
    """{Q, N, B, K, R} fitted together, and a Gauss-Markov process if needed; ``tolerance`` as of ``capped``.

    Raises ``InputError`` when the channel does not change, or no ordinate of the spectrum remains.
    """
    spectrum = binned(bands, highest_hz, masked).capped(tolerance)
    fit = fitted(spectrum)
    cornered = _cornered(bands, fit.strength)
    if any(c.any() for c in cornered):
        both = cornered if masked is None else [c | m for c, m in zip(cornered, masked, strict=True)]
        spectrum = binned(bands, highest_hz, both).capped(tolerance)
        fit = fitted(spectrum)
    step_s = min(band.step_s / band.block for band in bands)
    return _with_gauss_markov(step_s, Selection(fit, spectrum))


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


def _with_gauss_markov(step_s: float, plain: Selection) -> Selection:
    # Filters change a spectrum by a few per cent: a process must be significant beyond this tolerance.
    spectrum = plain.spectrum.capped(TOLERANCE_GAUSS_MARKOV)
    frequency, without = spectrum.frequency_hz, fitted(spectrum).deviance
    # With a shorter time constant the process is white in this log, with a longer one a random walk.
    shortest, longest = 1.0 / (2 * np.pi * frequency[-1]), 1.0 / (2 * np.pi * frequency[0])
    if not longest > 64 * shortest:
        return plain

    def gain(time_s: float) -> float:
        return without - fitted(spectrum.with_gauss_markov(step_s, time_s)).deviance

    # A corner in the uppermost three octaves is that of a filter, not of a process of the sensor.
    grid = np.geomspace(8 * shortest, longest / 2, max(4, int(np.log2(longest / shortest)) - 3))
    coarse = [gain(time_s) for time_s in grid]
    place = int(np.argmax(coarse))
    if coarse[place] < EVIDENCE_GAUSS_MARKOV / 2:
        return plain
    step = grid[1] / grid[0]
    fine = np.geomspace(max(grid[place] / step, grid[0]), grid[place] * step, 17)
    finer = [gain(time_s) for time_s in fine]
    place = int(np.argmax(finer))
    if finer[place] < EVIDENCE_GAUSS_MARKOV:
        return plain
    full = plain.spectrum.with_gauss_markov(step_s, float(fine[place]))
    return Selection(fitted(full), full, float(fine[place]), finer[place])
