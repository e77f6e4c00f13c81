"""Bias instability and rate random walk of a session, as the biases of its poses show them.

A hold of seconds shows neither; the means of some tens of poses over minutes do. Per axis, with one constant, the
biases y of poses at t with lengths T have the covariance

    V = σ² + s² I + K² [min(t, t') - δ T/6] - (B²/π) L

where σ² are the variances of the means by white noise, s the scatter of biases from pose to pose where that is known to
be there, and L the mean of ln|t - t'| over both windows, by its second integral x²/2 ln|x| - 3x²/4 (1/f noise
of two-sided density B²/2πf has no variance, only the variogram (2B²/π) ln; constants drop out beside the free mean).
The likelihood is restricted; B and K have flat priors in their logarithms and a weight on zero.
docs/noise.md, section 9.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.stats import chi2

from trihedron.arrays import FloatArray
from trihedron.records.pose_noise import Measured, Ratio

FEWEST_CONTRASTS = 11
"""A variance from eleven differences is known to a factor of 1.5, its root to 1.25: with fewer nothing is compared."""
SPACING = 1.3
"""Levels of B and of K are this factor apart, half of what an interval of 30 poses spans."""
LOWEST, HIGHEST = 0.03, 8.0
"""Range of the levels in parts of what the biases spread by: a tenth of it is not seen, three times it is refuted."""
LEAST_SIDE = 0.02
"""A side whose biases spread by less than this share of the other's is silent, as a simulation without noise is: how
silent says nothing more."""
SHOWS = 6.63
"""Twice the log-likelihood that a term must win over its absence: χ² of one degree of freedom passes it in 1 %, half
of that on the edge."""
MIDDLE_OF_WALK = 6.0
"""A walk's mean square about its mean over a span: K² span/6."""


@dataclass(frozen=True, eq=False)
class PoseBiases:
    """Biases of one axis (n,), their standard errors by white noise (n,), middles and lengths of the poses [s] (n,).

    ``scatters``: beside noise and drift every pose has an accident of its own, of a size that is then free.
    """

    values: FloatArray
    sigma: FloatArray
    time_s: FloatArray
    length_s: FloatArray
    scatters: bool = False

    @property
    def n_contrasts(self) -> int:
        """Biases less the constant."""
        return len(self.values) - 1

    @property
    def span_s(self) -> float:
        """From the first pose to the last."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def spread(self) -> float:
        """Root mean square about the mean, at least the white noise's."""
        return max(float(np.std(self.values)), float(np.median(self.sigma)))


@dataclass(frozen=True, eq=False)
class SlowDifference:
    """Slow noise of two sessions: the chance of such a difference between equal ones, and the term that carries it.

    ``first``, ``second`` per axis B and K of either; ``ratio`` per axis those of ``term``, first over second.
    """

    p_value: float
    term: Literal["B", "K"]
    first: tuple[dict[str, Measured], ...]
    second: tuple[dict[str, Measured], ...]
    ratio: tuple[dict[str, Ratio], ...]


def compare_slow(first: Sequence[PoseBiases], second: Sequence[PoseBiases]) -> SlowDifference | None:
    """Bias instability and rate random walk of two sessions, axis by axis; ``None`` where one has too few poses.

    Twice the log-likelihood by which B and K of either session's own beat common ones is held against χ² of two degrees
    of freedom an axis; the term whose own values alone win more of it is the one that differs.
    """
    if min(z.n_contrasts for z in (*first, *second)) < FEWEST_CONTRASTS:
        return None
    won, by_b, by_k = 0.0, 0.0, 0.0
    tables = []
    for one, other in zip(first, second, strict=True):
        least = LEAST_SIDE * max(one.spread, other.spread)
        one, other = (replace(z, sigma=np.hypot(z.sigma, LOWEST * least)) for z in (one, other))
        b = levels([max(z.spread, least) for z in (one, other)])
        k = levels([max(z.spread, least) / math.sqrt(z.span_s / MIDDLE_OF_WALK) for z in (one, other)])
        p, q = _table(one, b, k), _table(other, b, k)
        tables.append((b, k, p, q))
        together = float((p + q).max())
        won += float(p.max() + q.max()) - together
        # B of either, K in common; and the other way round.
        by_b += float((p.max(axis=0) + q.max(axis=0)).max()) - together
        by_k += float((p.max(axis=1) + q.max(axis=1)).max()) - together
    p_value = float(chi2.sf(2.0 * won, 2.0 * len(first)))
    sides = [tuple(_terms(t[j], t[0], t[1]) for t in tables) for j in (2, 3)]
    ratios = tuple(_ratios(*t) for t in tables)
    return SlowDifference(p_value, "B" if by_b > by_k else "K", sides[0], sides[1], ratios)


def levels(sizes: Sequence[float]) -> FloatArray:
    """Strengths to be tried, zero first, for biases spreading by ``sizes`` (what one unit of strength makes of it)."""
    low, high = LOWEST * min(sizes), HIGHEST * max(sizes)
    n = math.ceil(math.log(high / low) / math.log(SPACING)) + 1
    return np.concatenate([[0.0], np.geomspace(low, high, n)])


def _table(biases: PoseBiases, b: FloatArray, k: FloatArray) -> FloatArray:
    """(b, k) log-likelihood of the contrasts that are free of the constant, the best scatter for each."""
    basis = np.linalg.qr(np.ones((len(biases.values), 1)), mode="complete")[0][:, 1:]
    white, flicker, walk = (basis.T @ kernel @ basis for kernel in (np.diag(biases.sigma**2), *kernels(biases)))
    return best_scatter(basis.T @ biases.values, (white, flicker, walk), biases, b, k)


def best_scatter(
    contrasts: FloatArray,
    covariances: tuple[FloatArray, FloatArray, FloatArray],
    biases: PoseBiases,
    b: FloatArray,
    k: FloatArray,
) -> FloatArray:
    """(b, k) log-likelihood of ``contrasts`` (m,), the best scatter for each.

    ``covariances`` (m, m) are those of white noise, per B² and per K².
    """
    s = np.concatenate([[0.0], np.geomspace(0.15, 1.5, 5) * biases.spread]) if biases.scatters else np.zeros(1)
    out: FloatArray = _log_likelihood(contrasts, covariances, b, k, s).max(axis=2)
    return out


def _terms(table: FloatArray, b: FloatArray, k: FloatArray) -> dict[str, Measured]:
    weight = np.exp(table - table.max())
    out = {}
    for name, levels, of, absent in (("B", b, weight.sum(axis=1), table[0]), ("K", k, weight.sum(axis=0), table[:, 0])):
        reached = np.cumsum(of / of.sum())
        low, middle, high = (_quantile(levels, reached, p) for p in (0.025, 0.5, 0.975))
        needed = 2.0 * float(table.max() - absent.max()) > SHOWS
        sigma = math.log(high / max(low, LOWEST * high)) / 3.92 if high > 0.0 else 0.0
        out[name] = Measured(middle, low if needed else 0.0, high, sigma)
    return out


def _quantile(levels: FloatArray, reached: FloatArray, p: float) -> float:
    """Linear in the logarithm between the grid's points; zero where absence holds that much weight."""
    k = min(int(np.searchsorted(reached, p)), len(levels) - 1)
    if k == 0:
        return 0.0
    lower = float(levels[k - 1]) if k > 1 else float(levels[1]) / SPACING
    part = (p - float(reached[k - 1])) / max(float(reached[k] - reached[k - 1]), 1e-300)
    return lower * math.exp(part * math.log(float(levels[k]) / lower))


def _ratios(b: FloatArray, k: FloatArray, p: FloatArray, q: FloatArray) -> dict[str, Ratio]:
    """First over second of each term, the other term common to both sessions."""
    out = {}
    for name, levels, one, other in (("B", b, p, q), ("K", k, p.T, q.T)):
        joint = np.zeros((len(levels) - 1, len(levels) - 1))
        for j in range(one.shape[1]):
            joint += np.exp(one[1:, j][:, None] + other[1:, j][None, :] - one.max() - other.max())
        u = np.log(levels[1:])[:, None] - np.log(levels[1:])[None, :]
        order = np.argsort(u.ravel())
        reached = np.cumsum(joint.ravel()[order]) / max(float(joint.sum()), 1e-300)
        low, middle, high = (
            float(np.exp(u.ravel()[order][min(int(np.searchsorted(reached, x)), u.size - 1)]))
            for x in (0.025, 0.5, 0.975)
        )
        out[name] = Ratio(middle, low, high, 1.0)
    return out


def kernels(biases: PoseBiases) -> tuple[FloatArray, FloatArray]:
    """(n, n) covariance of the means of the poses per B² and per K², beside a free constant."""
    t, length = biases.time_s - biases.time_s[0], biases.length_s
    begin, end = t - length / 2.0, t + length / 2.0
    mean_log = (
        _twice_integrated(np.subtract.outer(end, begin)) - _twice_integrated(np.subtract.outer(end, end))
        - _twice_integrated(np.subtract.outer(begin, begin)) + _twice_integrated(np.subtract.outer(begin, end))
    ) / np.multiply.outer(length, length)  # fmt: skip
    walk = np.minimum.outer(t, t) + 0.5 * float(length[0]) - np.diag(length / 6.0)
    return -mean_log / math.pi, walk


def _twice_integrated(x: FloatArray) -> FloatArray:
    """The second integral of ln|x|: x²/2 ln|x| - 3x²/4."""
    size = np.maximum(np.abs(x), 1e-300)
    return size**2 * (0.5 * np.log(size) - 0.75)


def _log_likelihood(
    y: FloatArray, parts: tuple[FloatArray, FloatArray, FloatArray], b: FloatArray, k: FloatArray, s: FloatArray
) -> FloatArray:
    """(b, k, s) restricted log-likelihood of the contrasts."""
    m = len(y)
    out = np.empty((len(b), len(k), len(s)))
    for i, strength in enumerate(b):
        V = (
            parts[0] + strength**2 * parts[1]
            + (k**2)[:, None, None, None] * parts[2] + (s**2)[None, :, None, None] * np.eye(m)
        )  # fmt: skip
        half = np.linalg.cholesky(V)
        white = np.linalg.solve(half, np.broadcast_to(y[:, None], (*V.shape[:2], m, 1)))[..., 0]
        log_det = 2.0 * np.log(np.einsum("...ii->...i", half)).sum(axis=-1)
        out[i] = -0.5 * (log_det + (white**2).sum(axis=-1))
    return out
