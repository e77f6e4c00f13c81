"""Bias instability and rate random walk of a session, as the poses of a session show them.

A hold of seconds shows neither; the means of some tens of poses over minutes do. Per axis, with one constant, the
biases y of poses at t with lengths T have the covariance

    V = σ² + s² I + K² V_K + B² V_B,   V_K = min(t, t') - δ T/6,   V_B = -L/π

where σ² are the variances of the means by white noise, s the scatter of biases from pose to pose, free because every
pose may have an accident of its own, and L the mean of ln|t - t'| over both windows, by its second integral
x²/2 ln|x| - 3x²/4 (1/f noise of two-sided density B²/2πf has no variance, only the variogram (2B²/π) ln; constants drop
out beside the free mean). A pose tells one number of an accelerometer's bias: its part along gravity. With ``u`` (n, 3)
the directions of gravity the residuals of the lengths have

    V = σ² + s² I + Σ_k (u_k u_kᵀ) ∘ (B_k² V_B + K_k² V_K)

The likelihood is restricted to what the calibration does not take up; all strengths and ``s`` are integrated over a
low-discrepancy sequence: what one axis is taken to do changes what is left for the others. docs/noise.md, section 9.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.stats import chi2, qmc

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
MIDDLE_OF_WALK = 6.0
"""A walk's mean square about its mean over a span: K² span/6."""
DRAWS = {1: 4096, 3: 8192}
"""Points over the strengths of so many axes and a scatter: some hundred share the weight of a session of 30 poses."""
ABSENT = 0.1
"""Share of the points at which a strength is zero."""
SHOWN = 0.1
"""A strength is there where its absence has lost nine tenths of its odds (Jeffreys' strong evidence)."""
INTERVAL = np.array([0.025, 0.5, 0.975])
"""Ends of a 95 % interval and the median between."""


@dataclass(frozen=True, eq=False)
class PoseBiases:
    """Biases of one axis (n,), their standard errors by white noise (n,), middles and lengths of the poses [s] (n,).

    With directions ``up`` (n, 3) of gravity in the sensor: lengths of gravity less g, as any calibration leaves them.
    """

    values: FloatArray
    sigma: FloatArray
    time_s: FloatArray
    length_s: FloatArray
    up: FloatArray | None = None

    @property
    def basis(self) -> FloatArray:
        """(n, m) contrasts that no calibration changes: no constant of a gyro; no zero, scale or angle of the other."""
        if self.up is None:
            return np.linalg.qr(np.ones((len(self.values), 1)), mode="complete")[0][:, 1:]
        x, y, z = self.up.T
        design = np.column_stack([x, y, z, x * x, y * y, z * z, x * y, x * z, y * z])
        u, size, _ = np.linalg.svd(design)
        return u[:, int((size > 1e-6 * size[0]).sum()) :]

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
    """Bias instability and rate random walk of two sessions; ``None`` where one has too few poses.

    Twice the log-likelihood by which B and K of either session's own beat common ones (one B and one K for all axes of
    lengths of gravity) is held against χ² of two degrees of freedom an entry; the term whose own values alone win more
    of it is the one that differs. Figures and ratios are per axis.
    """
    if min(z.basis.shape[1] for z in (*first, *second)) < FEWEST_CONTRASTS:
        return None
    won, by_b, by_k = 0.0, 0.0, 0.0
    drawn: list[tuple[_Drawn, _Drawn]] = []
    for one, other in zip(first, second, strict=True):
        sides = tuple(_free_of_calibration(z) for z in (one, other))
        least = LEAST_SIDE * max(z.spread for z in sides)
        b = _levels([max(z.spread, least) for z in sides])
        k = _levels([max(z.spread, least) / math.sqrt(z.span_s / MIDDLE_OF_WALK) for z in sides])
        parts = [_Parts.of(z, least) for z in sides]
        p, q = (_log_likelihood(of, b, k) for of in parts)
        together = float((p + q).max())
        won += float(p.max() + q.max()) - together
        # B of either, K in common; and the other way round.
        by_b += float((p.max(axis=0) + q.max(axis=0)).max()) - together
        by_k += float((p.max(axis=1) + q.max(axis=1)).max()) - together
        drawn.append((_Drawn.of(parts[0], b, k), _Drawn.of(parts[1], b, k)))
    p_value = float(chi2.sf(2.0 * won, 2.0 * len(first)))
    sides_terms = [tuple(term for pair in drawn for term in pair[j].terms()) for j in (0, 1)]
    ratios = tuple(_ratios(*pair, axis) for pair in drawn for axis in range(pair[0].B.shape[1]))
    return SlowDifference(p_value, "B" if by_b > by_k else "K", sides_terms[0], sides_terms[1], ratios)


def _free_of_calibration(one: PoseBiases) -> PoseBiases:
    """The same contrasts, and nothing else that the spread would count."""
    basis = one.basis
    return replace(one, values=basis @ (basis.T @ one.values))


def _levels(sizes: Sequence[float]) -> FloatArray:
    """Strengths to be tried, zero first, for biases spreading by ``sizes`` (what one unit of strength makes of it)."""
    low, high = LOWEST * min(sizes), HIGHEST * max(sizes)
    n = math.ceil(math.log(high / low) / math.log(SPACING)) + 1
    return np.concatenate([[0.0], np.geomspace(low, high, n)])


@dataclass(frozen=True, eq=False)
class _Parts:
    """Contrasts (m,), their white covariance (m, m), those of each axis per B² and per K² (axes, m, m); a scatter."""

    contrasts: FloatArray
    white: FloatArray
    of_b: FloatArray
    of_k: FloatArray
    spread: float

    @classmethod
    def of(cls, one: PoseBiases, least: float) -> _Parts:
        """Of a session whose white noise is at least what makes ``least`` the least spread that is seen."""
        basis, up = one.basis, np.ones((len(one.values), 1)) if one.up is None else one.up
        gram = np.einsum("ik,jk->kij", up, up)
        of_b, of_k = (basis.T @ (gram * kernel) @ basis for kernel in _kernels(one))
        white = basis.T @ np.diag(one.sigma**2 + (LOWEST * least) ** 2) @ basis
        return cls(basis.T @ one.values, white, of_b, of_k, one.spread)

    def log_likelihood(self, V: FloatArray) -> FloatArray:
        """(...,) restricted log-likelihood of covariances (..., m, m) of the contrasts."""
        half = np.linalg.cholesky(V)
        left = np.linalg.solve(half, np.broadcast_to(self.contrasts[:, None], (*V.shape[:-1], 1)))[..., 0]
        log_det = 2.0 * np.log(np.einsum("...ii->...i", half)).sum(axis=-1)
        return np.asarray(-0.5 * (log_det + (left**2).sum(axis=-1)))


def _log_likelihood(parts: _Parts, b: FloatArray, k: FloatArray) -> FloatArray:
    """(b, k) log-likelihood of strengths that all axes share, the best scatter for each."""
    s = np.concatenate([[0.0], np.geomspace(0.15, 1.5, 5) * parts.spread])
    scatter = (s**2)[:, None, None] * np.eye(len(parts.contrasts))
    of_k = (k**2)[:, None, None, None] * parts.of_k.sum(axis=0) + parts.white + scatter
    of_b = parts.of_b.sum(axis=0)
    return np.array([parts.log_likelihood(of_k + strength**2 * of_b).max(axis=1) for strength in b])


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Strengths (draws, axes) of B and of K with the weight (draws,) that a session gives them."""

    B: FloatArray
    K: FloatArray
    weight: FloatArray

    @classmethod
    def of(cls, parts: _Parts, b: FloatArray, k: FloatArray) -> _Drawn:
        """Within levels ``b``, ``k``: flat in the logarithm, with a share of the points at zero."""
        axes = len(parts.of_b)
        u = qmc.Sobol(2 * axes + 1, seed=0).random(DRAWS[axes])
        depth, there = (u - ABSENT) / (1.0 - ABSENT), u >= ABSENT
        highest = np.r_[np.full(axes, b[-1]), np.full(axes, k[-1]), HIGHEST / 4.0 * parts.spread]
        part = np.exp(-np.log(b[-1] / b[1]) * depth) * there
        B, K, s = np.split(highest * part, [axes, 2 * axes], axis=1)
        V = parts.white + np.einsum("dk,kab->dab", B**2, parts.of_b) + np.einsum("dk,kab->dab", K**2, parts.of_k)
        log_weight = parts.log_likelihood(V + (s**2)[:, :, None] * np.eye(len(parts.contrasts)))
        weight = np.exp(log_weight - log_weight.max())
        return cls(B, K, weight / weight.sum())

    def terms(self) -> tuple[dict[str, Measured], ...]:
        """B and K of every axis: median and 95 % interval, from zero where zero is not excluded."""
        return tuple(
            {name: _measured(of, self.weight) for name, of in (("B", b), ("K", k))}
            for b, k in zip(self.B.T, self.K.T, strict=True)
        )


def _quantiles(values: FloatArray, weight: FloatArray, places: FloatArray) -> FloatArray:
    """Values (k,) below which shares ``places`` (k,) of the weight lie."""
    order = np.argsort(values)
    reached = np.cumsum(weight[order]) / max(float(weight.sum()), 1e-300)
    return values[order[np.minimum(np.searchsorted(reached, places), len(order) - 1)]]


def _measured(values: FloatArray, weight: FloatArray) -> Measured:
    low, middle, high = _quantiles(values, weight, INTERVAL).tolist()
    of_absent = float(weight[values == 0.0].sum())
    is_there = of_absent / max(1.0 - of_absent, 1e-300) < SHOWN * ABSENT / (1.0 - ABSENT)
    sigma = math.log(high / max(low, LOWEST * high)) / 3.92 if high > 0.0 else 0.0
    return Measured(middle, low if is_there else 0.0, high, sigma)


def _ratios(first: _Drawn, second: _Drawn, axis: int) -> dict[str, Ratio]:
    """First over second: every quantile of one beside every quantile of the other."""
    out = {}
    places = (np.arange(200) + 0.5) / 200
    for name in ("B", "K"):
        logs = []
        for one in (first, second):
            values = getattr(one, name)[:, axis]
            there = values > 0.0
            logs.append(np.log(_quantiles(values[there], one.weight[there], places)))
        low, middle, high = np.exp(np.quantile(np.subtract.outer(*logs), INTERVAL))
        out[name] = Ratio(float(middle), float(low), float(high), 1.0)
    return out


def _kernels(biases: PoseBiases) -> tuple[FloatArray, FloatArray]:
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
