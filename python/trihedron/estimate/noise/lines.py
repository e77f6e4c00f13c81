"""Parts of a spectrum that no sum of noise terms explains: spectral lines, and low-pass filtering."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from trihedron.arrays import TINY, FloatArray
from trihedron.estimate.noise.binned import BinnedSpectrum, Model, Range, binned, models_of_bins, within
from trihedron.estimate.noise.spectrum import Ordinates
from trihedron.probability import RARE_ALARM
from trihedron.records.noise import SpectralLine

TOLERANCE = 0.05
"""Least relative deviation of a third of an octave from the fitted terms, if significant, that counts as filtering:
noise terms are idealisations, and a smaller loss of white noise does not change a printed digit."""
MOST_LINES = 24
FLOOR = 0.5
"""Least share of white noise in the power at Nyquist beside a process; behind a low-pass there is only rounding."""


def find_lines(bands: Sequence[Ordinates], model: Model, step_s: float) -> tuple[list[SpectralLine], Sequence[Range]]:
    """Significant sinusoids above the fitted noise, and the ranges of frequency [Hz] that they affect."""
    lines: list[tuple[SpectralLine, float, int]] = []
    affected: list[Range] = []
    total = sum(len(band.power) for band in bands)
    for number, band in enumerate(bands):
        expected, slow = model.power(band, step_s), np.asarray(model.spectrum.fit.columns)
        power = band.power - 2 * slow @ band.cross + (slow @ band.columns) ** 2
        level = smooth_level(band, power / expected) * expected
        ratio = power / level
        limit = float(chdtri(band.count[0], RARE_ALARM / total) / band.count[0])
        mask = np.zeros(len(ratio), dtype=bool)
        for i in np.argsort(-ratio):
            if ratio[i] < limit or len(lines) >= MOST_LINES:
                break
            # The lowest eight ordinates contain drift; a period there has four cycles at most.
            if mask[i] or band.order[i] < 8:
                continue
            near = _skirt(ratio, int(i))
            mask[near] = True
            affected.append((float(band.frequency_hz[near][0]), float(band.frequency_hz[near][-1])))
            lines.append((_line(band, power[near], level[near], near), band.length * band.step_s, number))
    return _merged(lines), affected


def _merged(lines: Sequence[tuple[SpectralLine, float, int]]) -> list[SpectralLine]:
    """Merge lines of one frequency: powers inside a resonance are added, those of several stretches averaged."""
    groups: list[list[tuple[SpectralLine, float, int]]] = []
    for item in sorted(lines, key=lambda item: item[0].frequency_hz):
        last, line = groups[-1][-1][0] if groups else item[0], item[0]
        if groups and line.frequency_hz - last.frequency_hz < max(
            0.01 * last.frequency_hz, last.width_hz, line.width_hz
        ):
            groups[-1].append(item)
        else:
            groups.append([item])
    out = []
    for group in groups:
        same, times_s, numbers = zip(*group, strict=True)
        strength = np.array([line.amplitude**2 for line in same])
        places = np.array([line.frequency_hz for line in same])
        power = float(strength @ np.array(times_s)) / sum(dict(zip(numbers, times_s, strict=True)).values())
        best = same[int(np.argmax(strength))]
        out.append(
            replace(
                best,
                frequency_hz=float(np.sum(strength * places) / np.sum(strength)),
                amplitude=math.sqrt(power),
                width_hz=max(best.width_hz, float(np.ptp(places))),
            )
        )
    return out


def _skirt(ratio: FloatArray, peak: int) -> slice:
    """Ordinates affected by a peak: outward until the mean ratio of the next 24 is below 1.4."""
    window = 24
    start = stop = peak
    while start > 0 and np.mean(ratio[max(0, start - window) : start]) > 1.4:
        start = max(0, start - window // 4)
    while stop < len(ratio) - 1 and np.mean(ratio[stop + 1 : stop + 1 + window]) > 1.4:
        stop = min(len(ratio) - 1, stop + window // 4)
    return slice(max(0, start - 4), stop + 5)


def _line(band: Ordinates, power: FloatArray, expected: FloatArray, near: slice) -> SpectralLine:
    time_s = band.length * band.step_s
    excess = np.maximum(power - expected, 0.0)
    total = float(max(np.sum(power - expected), np.max(excess)))
    amplitude = math.sqrt(2.0 * total / time_s)
    frequency = float(np.sum(excess * band.frequency_hz[near]) / np.sum(excess))
    spread = math.sqrt(float(np.sum(excess * (band.frequency_hz[near] - frequency) ** 2) / np.sum(excess)))
    return SpectralLine(
        frequency_hz=frequency,
        amplitude=amplitude,
        width_hz=max(0.0, 2.0 * spread - 2.0 / time_s),
    )


def smooth_level(band: Ordinates, ratio: FloatArray) -> FloatArray:
    """(k,) local level of ``ratio`` from medians of many ordinates, so that broad deviations are not lines."""
    width = min(512, len(ratio) // 8)
    n = len(ratio) // max(width, 1)
    if width < 16:
        return np.ones_like(ratio)
    # Median of a chi-square per degree of freedom (Wilson-Hilferty).
    centre = (1.0 - 2.0 / (9.0 * band.count[0])) ** 3 if band.count[0] > 1 else 0.4549
    level = np.log(np.maximum(np.median(ratio[: n * width].reshape(n, width), axis=1) / centre, 1e-12))
    # Continued at both ends: behind a filter the spectrum is steep there.
    level = np.r_[2.0 * level[0] - level[1], level, 2.0 * level[-1] - level[-2]]
    places = (np.arange(-1, n + 1) + 0.5) * width
    return np.asarray(np.exp(np.interp(np.arange(len(ratio)), places, level)))


def white_limit(
    bands: Sequence[Ordinates], nyquist_hz: float, affected: Sequence[Range], rounding: float = 0.0
) -> tuple[float, float]:
    """Upper end [Hz] of the fit band, up to which the spectrum is a sum of terms, and power at Nyquist over the terms'.

    The upper two octaves of the band are compared, by thirds of an octave, with the fit of all terms; while one of them
    deviates, the band is reduced by half an octave. A process of some readings bends the spectrum as a filter does, but
    leaves white noise above its corner, more than the ``rounding`` of the ADC (density): the band is then the whole.
    """
    masked = within(bands, affected)
    whole, highest = binned(bands, nyquist_hz, masked), nyquist_hz
    spectrum = whole
    while _deviates(spectrum, highest) or _droops(spectrum, highest):
        if highest == nyquist_hz and _has_floor(whole, highest, min(b.step_s / b.block for b in bands), rounding):
            break
        if highest / np.sqrt(2.0) < 16.0 * spectrum.frequency_hz[0]:
            return highest, float("nan")
        highest /= np.sqrt(2.0)
        spectrum = binned(bands, highest, masked)
    top = whole.frequency_hz > 0.9 * nyquist_hz
    # Q of the band below would rise with frequency beyond it.
    fit = spectrum.likelihood.fit((1, 2, 3))
    return highest, float(np.mean(whole.ratio(fit)[top])) if top.any() else math.nan


def _has_floor(whole: BinnedSpectrum, highest_hz: float, step_s: float, rounding: float) -> bool:
    """Whether a Gauss-Markov process explains the spectrum beside white noise that is most of its uppermost part."""
    spectrum = models_of_bins(step_s, whole)[-1].spectrum
    strength = np.asarray(spectrum.fit.strength)
    if len(strength) == len(whole.basis) or _deviates(spectrum, highest_hz):
        return False
    return bool(strength[1] - rounding > FLOOR * float(strength @ spectrum.basis[:, -1]))


def _droops(spectrum: BinnedSpectrum, highest_hz: float) -> bool:
    """Whether the top of the band falls below the terms fitted two octaves below it, as no noise term does."""
    low = spectrum.frequency_hz <= highest_hz / 4.0
    near = low & (spectrum.frequency_hz > highest_hz / 32.0)
    if np.count_nonzero(low) < 8 or not near.any():
        return False
    below = spectrum.below(highest_hz / 4.0)
    ratio = spectrum.ratio(below.likelihood.fit((1, 2, 3)))
    # The level below is a median of bins, robust to a resonance there.
    level = float(np.median(ratio[near]))
    top = spectrum.frequency_hz > highest_hz / 2.0 ** (1 / 3)
    count = spectrum.count[top].sum()
    if not count or not level > 0.0:
        return False
    mean = float(np.sum(ratio[top] * spectrum.count[top]) / count) / level
    return mean < 1.0 - max(TOLERANCE, 3.0 * math.sqrt(2.0 / count + 4.0 / below.count.sum()))


def _deviates(spectrum: BinnedSpectrum, highest_hz: float) -> bool:
    upper = spectrum.frequency_hz > highest_hz / 4.0
    key = np.floor(3.0 * np.log2(highest_hz / spectrum.frequency_hz[upper]) + 1e-9).astype(np.int64)
    count, ratio = spectrum.count[upper], spectrum.ratio()[upper]
    n = np.maximum(np.bincount(key, count), TINY)
    mean = np.bincount(key, count * ratio) / n
    return bool(np.any((n >= 8) & (np.abs(mean - 1.0) > np.maximum(TOLERANCE, 4.5 * np.sqrt(2.0 / n)))))
