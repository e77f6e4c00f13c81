"""Bias instability and walk of an accelerometer, as the length of gravity in the poses of a session shows them.

A pose tells one number of an accelerometer's bias: its part along gravity. With ``u`` (n, 3) the directions of gravity
in the poses and ``V_B``, ``V_K`` the covariance of one axis' bias per B² and per K² (:mod:`of_biases`), the residuals
of the lengths have

    V = σ² + s² I + Σ_k (u_k u_kᵀ) ∘ (B_k² V_B + K_k² V_K)

seen by what is orthogonal to the six products and three components of ``u``, which scales, angles and biases of any
calibration take up. B and K of an axis are integrated over a low-discrepancy grid of all six strengths and ``s``: what
one axis is taken to do changes what is left for the others. docs/noise.md, section 9.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2, qmc

from trihedron.arrays import FloatArray
from trihedron.estimate.noise.of_biases import (
    FEWEST_CONTRASTS,
    HIGHEST,
    LEAST_SIDE,
    LOWEST,
    MIDDLE_OF_WALK,
    PoseBiases,
    SlowDifference,
    best_scatter,
    kernels,
    levels,
)
from trihedron.records.pose_noise import Measured, Ratio

DRAWS = 8192
"""Points over six strengths and a scatter: some hundred of them share the weight of a session of 30 poses."""
ABSENT = 0.1
"""Share of the points at which a strength is zero."""
SHOWN = 0.1
"""A strength is there where its absence has lost nine tenths of its odds (Jeffreys' strong evidence)."""
AXES = 3
INTERVAL = np.array([0.025, 0.5, 0.975])
"""Ends of a 95 % interval and the median between."""


@dataclass(frozen=True, eq=False)
class PoseNorms:
    """Lengths of gravity less g (n,), as any calibration leaves them, with directions ``up`` (n, 3) in the sensor."""

    norms: PoseBiases
    up: FloatArray

    @property
    def basis(self) -> FloatArray:
        """(n, m) contrasts that no zero, scale or angle of an accelerometer changes."""
        x, y, z = self.up.T
        design = np.column_stack([x, y, z, x * x, y * y, z * z, x * y, x * z, y * z])
        u, size, _ = np.linalg.svd(design)
        rank = int((size > 1e-6 * size[0]).sum())
        return u[:, rank:]


def compare_slow_norms(first: PoseNorms, second: PoseNorms) -> SlowDifference | None:
    """B and K of two sessions of an accelerometer; ``None`` where one has too few poses.

    Whether they differ is judged with one B and one K for all axes: twice the log-likelihood by which own values beat
    common ones, against χ² of two degrees of freedom. Figures and ratios are per axis.
    """
    if min(one.basis.shape[1] for one in (first, second)) < FEWEST_CONTRASTS:
        return None
    first, second = _free_of_calibration(first), _free_of_calibration(second)
    sides = (first.norms, second.norms)
    least = LEAST_SIDE * max(z.spread for z in sides)
    b = levels([max(z.spread, least) for z in sides])
    k = levels([max(z.spread, least) / math.sqrt(z.span_s / MIDDLE_OF_WALK) for z in sides])
    p, q = (_of_all_axes(one, b, k, least) for one in (first, second))
    together = float((p + q).max())
    won = float(p.max() + q.max()) - together
    by_b = float((p.max(axis=0) + q.max(axis=0)).max()) - together
    by_k = float((p.max(axis=1) + q.max(axis=1)).max()) - together
    drawn = [_Drawn.of(one, float(b[-1]), float(k[-1]), least) for one in (first, second)]
    terms = tuple(one.terms() for one in drawn)
    ratios = tuple(_ratios(drawn[0], drawn[1], axis) for axis in range(AXES))
    p_value = float(chi2.sf(2.0 * won, 2.0))
    return SlowDifference(p_value, "B" if by_b > by_k else "K", terms[0], terms[1], ratios)


def _free_of_calibration(one: PoseNorms) -> PoseNorms:
    """The same contrasts, and nothing else that the spread would count."""
    basis = one.basis
    return replace(one, norms=replace(one.norms, values=basis @ (basis.T @ one.norms.values)))


def _parts(one: PoseNorms, least: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Contrasts (m,), their white covariance (m, m), and those of each axis per B² and per K² (3, m, m)."""
    basis, biases = one.basis, one.norms
    flicker, walk = kernels(biases)
    gram = np.einsum("ik,jk->kij", one.up, one.up)
    of_b, of_k = (np.einsum("ia,kij,jb->kab", basis, gram * kernel, basis) for kernel in (flicker, walk))
    white = basis.T @ np.diag(biases.sigma**2 + (LOWEST * least) ** 2) @ basis
    return basis.T @ biases.values, white, of_b, of_k


def _of_all_axes(one: PoseNorms, b: FloatArray, k: FloatArray, least: float) -> FloatArray:
    """(b, k) log-likelihood of strengths that all axes share, the best scatter for each."""
    y, white, of_b, of_k = _parts(one, least)
    return best_scatter(y, (white, of_b.sum(axis=0), of_k.sum(axis=0)), one.norms, b, k)


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Strengths (draws, 3) of B and of K with the weight (draws,) that a session gives them."""

    B: FloatArray
    K: FloatArray
    weight: FloatArray

    @classmethod
    def of(cls, one: PoseNorms, highest_b: float, highest_k: float, least: float) -> _Drawn:
        u = qmc.Sobol(2 * AXES + 1, seed=0).random(DRAWS)
        # Flat in the logarithm, with a share of the points at zero.
        span = np.log(HIGHEST / LOWEST)
        part = np.exp(-span * (u - ABSENT) / (1.0 - ABSENT)) * (u >= ABSENT)
        B, K = highest_b * part[:, :AXES], highest_k * part[:, AXES : 2 * AXES]
        s = HIGHEST / 4.0 * one.norms.spread * part[:, -1]
        y, white, of_b, of_k = _parts(one, least)
        V = white + np.einsum("dk,kab->dab", B**2, of_b) + np.einsum("dk,kab->dab", K**2, of_k)
        V += (s**2)[:, None, None] * np.eye(len(y))
        half = np.linalg.cholesky(V)
        left = np.linalg.solve(half, np.broadcast_to(y[:, None], (DRAWS, len(y), 1)))[..., 0]
        log_det = 2.0 * np.log(np.einsum("dii->di", half)).sum(axis=-1)
        log_weight = -0.5 * (log_det + (left**2).sum(axis=-1))
        weight = np.exp(log_weight - log_weight.max())
        return cls(B, K, weight / weight.sum())

    def terms(self) -> tuple[dict[str, Measured], ...]:
        """B and K of every axis: median and 95 % interval, from zero where zero is not excluded."""
        return tuple(
            {name: _measured(of[:, axis], self.weight) for name, of in (("B", self.B), ("K", self.K))}
            for axis in range(AXES)
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
