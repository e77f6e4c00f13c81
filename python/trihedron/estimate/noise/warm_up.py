"""A bias that warms up: an exponential approach, which no noise term is, told from a random walk by evidence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray

MEANS = 64
"""Means of equal length that the log is judged by: white noise and a walk are all that they show."""
LEAST = 32
"""Of them that must hold readings."""
WALKS = np.concatenate([[0.0], np.geomspace(1e-3, 1e4, 29)])
"""Variances of a walk from mean to mean that are tried, in units of the white variance of a mean."""
TIMES = np.geomspace(0.02, 0.5, 15)
"""Time constants that are tried, in lengths of the log: slower is a straight line or a walk, as far as it can tell."""
EARNED = 20.0
"""Rise of twice the log-likelihood that it must earn: its time was searched, too. Of 900 logs without
one, 450 of them with a walk, four earned 16."""


@dataclass(frozen=True)
class WarmUp:
    """A bias that changes by ``size`` over the log, as 1 - exp(-t/``time_s``)."""

    size: float
    time_s: float

    def at(self, t: FloatArray) -> FloatArray:
        """(n,) what is left of the way at times (n,) [s] after the first reading, the end being none."""
        return -self.size * np.exp(-t / self.time_s)


def warm_up(x: FloatArray, rate_hz: float) -> WarmUp | None:
    """The warm-up of readings ``x`` (n,), NaN where none is; ``None`` where a straight line beside a random walk and
    white noise of any strength does as well."""
    n = len(x) // MEANS
    if n < 1:
        return None
    blocks = x[: n * MEANS].reshape(MEANS, n)
    count = np.isfinite(blocks).sum(axis=1)
    held = 2 * count >= n
    if np.count_nonzero(held) < LEAST:
        return None
    y = np.nansum(blocks[held], axis=1) / count[held]
    t = (np.flatnonzero(held) + 0.5) / MEANS
    walk = MEANS * np.minimum.outer(t, t)
    columns = np.column_stack([y, np.ones_like(t), t, np.exp(-t[:, None] / TIMES)])
    without, tried = [], []
    for strength in WALKS:
        factor = np.linalg.cholesky(np.eye(len(t)) + strength * walk)
        white = np.linalg.solve(factor, columns)
        constant = -float(np.sum(np.log(np.diag(factor))))
        without.append(constant + _fitted(white[:, :3])[0])
        for k, time in enumerate(TIMES):
            likelihood, weight = _fitted(white[:, [0, 1, 2, 3 + k]])
            tried.append((constant + likelihood, weight, float(time)))
    best, weight, time = max(tried)
    if 2.0 * (best - max(without)) < EARNED:
        return None
    return WarmUp(-weight, time * MEANS * n / rate_hz)


def _fitted(white: FloatArray) -> tuple[float, float]:
    """Log-likelihood of whitened means, the first column, by the others with a free scale; the last one's weight."""
    weight, _, _, _ = np.linalg.lstsq(white[:, 1:], white[:, 0], rcond=None)
    left = float(np.sum((white[:, 0] - white[:, 1:] @ weight) ** 2))
    k = len(white)
    return float(-0.5 * k * np.log(max(left, 1e-300) / k)), float(weight[-1])
