"""A level that switches between two values in a static log (telegraph noise).

A spectrum does not tell it from flicker or a bounded walk; but means of short stretches have two values, those of
Gaussian noise have all.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.noise.slow_changes import block_means

MEANS = 256
"""Number of means of equal length: switches after two of them or more are seen."""
TIMES = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""Correlation times, in means, of the Gaussian processes with the same spectrum; a walk and flicker are tried too."""
STRENGTHS = np.concatenate([[0.0], np.geomspace(1e-2, 1e4, 25)])
"""Their variances, in units of the white variance of a mean."""
EARNED = 20.0
"""Least excess of twice the log-likelihood over the best Gaussian process. By Markov's inequality a likelihood ratio of
e^10 for levels that are given comes by chance in e^-10 = 5e-5 of logs. With fitted levels, and any number of switches,
it is 6e-4 in Gauss-Markov noise and 9e-5 at the most in white noise, a walk and flicker (benches/static_screening.py);
those with ``FEWEST`` switches are fewer."""
FEWEST = 4
"""Fewest switches; fewer are steps."""
ROUNDS = 25
"""Iterations of the levels' likelihood."""


@dataclass(frozen=True)
class TwoLevels:
    """Levels ``size`` apart, ``n_switches`` in the log, each held for ``held_s`` on average; ``rise`` is twice the rise
    of the log-likelihood above the best Gaussian process."""

    size: float
    n_switches: int
    held_s: float
    rise: float


def two_levels(x: FloatArray, rate_hz: float) -> TwoLevels | None:
    """The two levels of readings ``x`` (n,), NaN where missing; ``None`` where Gaussian noise explains them as well."""
    found = block_means(x, MEANS)
    if found is None:
        return None
    y, t, _ = found
    y = np.interp((np.arange(MEANS) + 0.5) / MEANS, t, y)
    scale = float(y.std())
    if scale == 0.0:
        return None
    likelihood, levels, is_high = _switching((y - y.mean()) / scale)
    n_switches = int(np.count_nonzero(np.diff(is_high)))
    rise = 2.0 * (likelihood - _gaussian((y - y.mean()) / scale))
    if n_switches < FEWEST or rise < EARNED:
        return None
    duration_s = len(x) / rate_hz
    return TwoLevels(scale * abs(float(levels[1] - levels[0])), n_switches, duration_s / (n_switches + 1), rise)


def _switching(y: FloatArray) -> tuple[float, FloatArray, BoolArray]:
    """Log-likelihood of two levels with white noise and Markov switches (Baum-Welch), the levels, and which is held."""
    levels, variance = np.quantile(y, [0.15, 0.85]), 0.5 * float(np.var(np.diff(y))) + 1e-12
    leave, n = np.array([0.05, 0.05]), len(y)
    likelihood, weight = -math.inf, np.zeros((n, 2))
    for _ in range(ROUNDS):
        exponent = -0.5 * (y[:, None] - levels) ** 2 / variance
        top = exponent.max(axis=1)
        seen = np.exp(exponent - top[:, None])
        move = np.array([[1.0 - leave[0], leave[0]], [leave[1], 1.0 - leave[1]]])
        forward, backward, share = np.empty((n, 2)), np.ones((n, 2)), np.empty(n)
        ahead = np.full(2, 0.5)
        for i in range(n):
            forward[i] = ahead * seen[i]
            share[i] = forward[i].sum()
            forward[i] /= share[i]
            ahead = forward[i] @ move
        for i in range(n - 2, -1, -1):
            backward[i] = move @ (seen[i + 1] * backward[i + 1]) / share[i + 1]
        likelihood = float(np.sum(np.log(share) + top)) - 0.5 * n * math.log(2.0 * math.pi * variance)
        weight = forward * backward
        weight /= weight.sum(axis=1, keepdims=True)
        pairs = np.einsum("ni,ij,nj->ij", forward[:-1], move, (seen * backward / share[:, None])[1:])
        levels = (weight * y[:, None]).sum(axis=0) / weight.sum(axis=0)
        variance = max(float((weight * (y[:, None] - levels) ** 2).sum()) / n, 1e-12)
        leave = np.array([pairs[0, 1] / pairs[0].sum(), pairs[1, 0] / pairs[1].sum()]).clip(1e-3, 0.5)
    return likelihood, levels, weight[:, 1] > 0.5


def _gaussian(y: FloatArray) -> float:
    """Largest log-likelihood of white noise with one other Gaussian process of any strength, the mean free."""
    dof, best = len(y) - 1, -math.inf
    for power, across in _processes():
        variance = 1.0 + STRENGTHS[:, None] * power
        left = ((across @ y) ** 2 / variance).sum(axis=1)
        best = max(best, float(np.max(-0.5 * (np.log(variance).sum(axis=1) + dof * (np.log(left / dof) + 1.0)))))
    return best - 0.5 * dof * math.log(2.0 * math.pi)


@cache
def _processes() -> tuple[tuple[FloatArray, FloatArray], ...]:
    """Of each process: variances and directions (rows) of its independent parts, orthogonal to the mean."""
    contrasts = np.linalg.svd(np.ones((1, MEANS)))[2][1:]
    found = []
    for covariance in _covariances():
        power, vectors = np.linalg.eigh(contrasts @ covariance @ contrasts.T)
        found.append((np.maximum(power, 0.0), vectors.T @ contrasts))
    return tuple(found)


def _covariances() -> Iterator[FloatArray]:
    index = np.arange(MEANS)
    yield np.minimum.outer(index, index) + 0.5
    # 1/f noise by Kasdin's filter: fractional integration of order one half.
    taps = np.cumprod(np.concatenate([[1.0], (np.arange(1, MEANS) - 0.5) / np.arange(1, MEANS)]))
    filtered = np.array([np.concatenate([taps[: i + 1][::-1], np.zeros(MEANS - i - 1)]) for i in index])
    yield filtered @ filtered.T
    for time in TIMES:
        yield np.exp(-np.abs(np.subtract.outer(index, index)) / time)
