"""A level that switches between two values in a static log (telegraph noise).

A spectrum does not tell it from flicker or a bounded walk; but means of short stretches have two values, those of
Gaussian noise have all.
"""

import math
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.noise.slow_changes import block_means

EARNED = 20.0
"""Least excess of twice the log-likelihood over the best Gaussian process. By Markov's inequality a likelihood ratio of
e^10 for levels that are given comes by chance in e^-10 = 5e-5 of logs. With fitted levels, and any number of switches,
it is 3e-4 in Gauss-Markov noise and 1e-4 at the most in white noise, a walk and flicker (benches/static_screening.py);
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
    means = block_means(x)
    if means is None:
        return None
    scale = float(means.y.std())
    likelihood, levels, is_high = _switching((means.y - means.y.mean()) / scale)
    n_switches = int(np.count_nonzero(np.diff(is_high)))
    deviance = min(means.likely(np.empty((0, len(means.coefficients))), noise).deviance for noise in means.noises)
    rise = 2.0 * likelihood + deviance + len(means.coefficients) * math.log(2.0 * math.pi / scale**2)
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
