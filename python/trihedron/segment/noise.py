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
        model = np.maximum(seen, 0.1 * seen.max() * tau[0] / tau)
        for _ in range(4):
            weight = np.sqrt(n) / model
            terms[channel], _ = optimize.nnls(design * weight[:, None], seen * weight)
            model = np.maximum(design @ terms[channel], 1e-3 * seen.max() * tau[0] / tau)
    return MeanNoise(terms[:, 0], terms[:, 1], terms[:, 2])
