"""How far the mean of a stretch is from the next stretch's: noise over time, pooled over all holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import optimize, stats

from trihedron.segment.channels import Channels, FloatArray

Range = tuple[int, int]


@dataclass(frozen=True, eq=False)
class MeanNoise:
    """Variance of the mean over a duration T, per channel: ``white/T + flicker + walk·T/3`` (docs/segmentation.md (6)).

    ``white``, ``flicker``, ``walk`` (c,) in raw unit squared (times s, 1, 1/s).
    """

    white: FloatArray
    flicker: FloatArray
    walk: FloatArray

    def variance(self, duration_s: float) -> FloatArray:
        """(c,) variance of a mean over ``duration_s`` about the mean of a like stretch next to it, halved."""
        out: FloatArray = self.white / duration_s + self.flicker + self.walk * duration_s / 3.0
        return out


def two_sample_differences(mean: FloatArray, size: int) -> FloatArray:
    """(k, c) halved squares of differences of neighbouring means of ``size`` blocks (not overlapping)."""
    whole = len(mean) // size
    averaged = mean[: whole * size].reshape(whole, size, mean.shape[1]).mean(axis=1)
    pairs = averaged[: whole // 2 * 2].reshape(-1, 2, mean.shape[1])
    out: FloatArray = (pairs[:, 1] - pairs[:, 0]) ** 2 / 2.0
    return out


def pool_mean_noise(channels: Channels, ranges: list[Range], is_robust: bool = False) -> MeanNoise:
    """Fit the noise law to the two-sample variances of all stretches of blocks together, at dyadic durations.

    Weights are those of a variance with as many degrees of freedom as there are differences; robust means the median
    of the squares (over that of chi-square with one degree of freedom), for use before the edges are trimmed.
    """
    n_channels = channels.mean.shape[1]
    longest = max(last - first for first, last in ranges)
    taus, counts, variances = [], [], []
    size = 1
    while size <= longest // 2:
        squares = np.vstack([two_sample_differences(channels.mean[a:b], size) for a, b in ranges])
        if len(squares):
            pooled = np.median(squares, axis=0) / stats.chi2.median(1) if is_robust else squares.mean(axis=0)
            taus.append(size * channels.step_s)
            counts.append(float(len(squares)))
            variances.append(pooled)
        # A stretch's own halves reach further than the last power of two in it: the mean of the whole is extrapolated.
        own = [(a, b) for a, b in ranges if size < (b - a) // 2 < 2 * size]
        if len(own) > 1:
            squares = np.vstack([two_sample_differences(channels.mean[a:b], (b - a) // 2)[:1] for a, b in own])
            taus.append(float(np.mean([(b - a) // 2 for a, b in own])) * channels.step_s)
            counts.append(float(len(own)))
            variances.append(np.median(squares, axis=0) / stats.chi2.median(1) if is_robust else squares.mean(axis=0))
        size *= 2
    rounding = channels.quantisation_variance / channels.length
    if not taus:
        white = np.vstack([channels.variance[a:b] for a, b in ranges]).mean(axis=0) / channels.length
        return MeanNoise(np.maximum(white, rounding) * channels.step_s, np.zeros(n_channels), np.zeros(n_channels))
    tau, n = np.array(taus), np.array(counts)
    design = np.column_stack([1.0 / tau, np.ones_like(tau), tau / 3.0])
    terms = np.zeros((n_channels, 3))
    for channel in range(n_channels):
        seen = np.array([v[channel] for v in variances]) + 1e-6 * rounding[channel]
        if not np.any(seen > 0.0):
            continue
        fits = [_fit(design, seen, n, chosen) for chosen in TERMS]
        criterion = np.array([fit[0] for fit in fits])
        weight = np.exp(-0.5 * (criterion - criterion.min()))
        terms[channel] = np.average([fit[1] for fit in fits], axis=0, weights=weight)
    return MeanNoise(terms[:, 0], terms[:, 1], terms[:, 2])


TERMS = ([0], [0, 1], [0, 2], [0, 1, 2])
"""White alone; with flicker; with walk; with both. The law is their average by Akaike's weights: a term must earn
its place, or it would inflate every error, and none is struck out for good by too short a log."""


def _fit(design: FloatArray, seen: FloatArray, n: FloatArray, chosen: list[int]) -> tuple[float, FloatArray]:
    """Akaike's criterion and the non-negative terms of one choice.

    A variance with n degrees of freedom has the deviance n (s/v - 1 - ln(s/v)); a term costs 2.
    """
    terms = np.zeros(3)
    least = 1e-3 * seen.max() * design[:, 0] / design[0, 0]
    model = np.maximum(seen, 100.0 * least)
    for _ in range(5):
        weight = np.sqrt(n) / model
        terms[chosen], _ = optimize.nnls(design[:, chosen] * weight[:, None], seen * weight)
        model = np.maximum(design @ terms, least)
    ratio = np.maximum(seen, 1e-3 * least) / model
    return float((n * (ratio - 1.0 - np.log(ratio))).sum()) + 2.0 * len(chosen), terms
