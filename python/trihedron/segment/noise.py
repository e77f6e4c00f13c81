"""Noise of means over time: differences between the means of neighbouring intervals, pooled over all poses."""

import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core, probability
from trihedron.arrays import FloatArray, IntArray
from trihedron.quantiles import medians
from trihedron.ranges import Range
from trihedron.segment.channels import Channels


@dataclass(frozen=True, eq=False)
class MeanNoise:
    """Variance of the mean over a duration T, per channel: ``white/T + flicker + walk·T/3`` (docs/segmentation.md (6)).

    ``white``, ``flicker``, ``walk`` (c,) in raw unit squared (times s, 1, 1/s).
    """

    white: FloatArray
    flicker: FloatArray
    walk: FloatArray

    def variance(self, duration_s: float | FloatArray) -> FloatArray:
        """Half the variance of the difference between the means of two neighbouring intervals of ``duration_s``.

        (c,) for one duration, (k, c) for a column (k, 1) of them.
        """
        return self.white / duration_s + self.flicker + self.walk * duration_s / 3.0


@dataclass(frozen=True, eq=False)
class HalvesDifferences:
    """Repeated halving of intervals: ``square`` (k, c) half the squared difference of the means of two halves.

    ``size`` (k,) blocks in a half (harmonic mean where the halves differ by one), ``depth`` (k,) 0 for the interval as
    a whole, ``stretch`` (k,) its index. For white noise the differences are independent of each other and complete (an
    unbalanced Haar transform): n blocks give n - 1.
    """

    square: FloatArray
    size: FloatArray
    depth: IntArray
    stretch: IntArray


def split_by_halves(mean: FloatArray, ranges: list[Range]) -> HalvesDifferences:
    """Differences of the halves of every range of blocks ``mean`` (m, c), of their halves, and so on to one block."""
    return HalvesDifferences(*_core.halves_of(mean, np.array(ranges, dtype=np.int64).reshape(-1, 2)))


def pool_mean_noise(
    channels: Channels, ranges: list[Range], is_robust: bool = False, excess: FloatArray | None = None
) -> MeanNoise:
    """Fit white noise, flicker and walk to the differences of halves of all ranges of blocks together, by octave.

    Weights are those of a variance with as many degrees of freedom as there are differences; robust uses the median of
    the squares (over that of chi-square with one degree of freedom), for use before the edges are trimmed. ``excess``
    (ranges, c) is by how much the variance of each is larger.
    """
    n_channels = channels.mean.shape[1]
    halves = split_by_halves(channels.mean, ranges)
    if excess is not None:
        halves = replace(halves, square=halves.square / excess[halves.stretch])
    rounding = channels.quantisation_variance / channels.length
    if not len(halves.size):
        white = np.vstack([channels.variance[a:b] for a, b in ranges]).mean(axis=0) / channels.length
        return MeanNoise(np.maximum(white, rounding) * channels.step_s, np.zeros(n_channels), np.zeros(n_channels))
    # Octaves centred on the powers of two.
    octave = np.round(np.log2(halves.size)).astype(np.int64)
    members = [octave == k for k in np.unique(octave)]
    n = np.array([float(m.sum()) for m in members])
    if is_robust:
        variances = np.array([medians(halves.square[m]) for m in members]) / probability.chdtri(1, 0.5)
    else:
        variances = np.array([halves.square[m].mean(axis=0) for m in members])
    tau = halves.size * channels.step_s
    design = np.array([[np.mean(1.0 / tau[m]), 1.0, np.mean(tau[m]) / 3.0] for m in members])
    terms = np.zeros((n_channels, 3))
    for triad in range(n_channels // 3):
        seen = {c: variances[:, c] + 1e-6 * rounding[c] for c in range(3 * triad, 3 * triad + 3)}
        alive = [c for c, variance in seen.items() if np.any(variance > 0.0)]
        if not alive:
            continue
        # Fewer durations than terms do not determine these.
        tried = [chosen for chosen in TERMS if len(chosen) <= len(n)]
        fits = [[_core.mean_noise_terms(design, seen[c], n, chosen) for c in alive] for chosen in tried]
        cost = len(alive) * math.log(max(len(ranges), 2)) * np.array([len(chosen) for chosen in tried])
        # A variance with n degrees of freedom has the deviance n (s/v - 1 - ln(s/v)).
        criterion = np.array([sum(fit[0] for fit in axes) for axes in fits]) + cost
        weight = np.exp(-0.5 * (criterion - criterion.min()))
        terms[alive] = np.average([[fit[1] for fit in axes] for axes in fits], axis=0, weights=weight)
    return MeanNoise(terms[:, 0], terms[:, 1], terms[:, 2])


TERMS = ([0], [0, 1], [0, 2], [0, 1, 2])
"""White noise; with flicker; with walk; with both. The result is their average with weights by Schwarz's criterion. A
term costs the logarithm of the number of ranges, because a slow term shows once in each: a term without support would
inflate every error, and none is dropped for good in too short a log. Terms are chosen for the three axes of a sensor
together, which are alike: a few coarse differences of one axis determine little, and would be extrapolated far."""
