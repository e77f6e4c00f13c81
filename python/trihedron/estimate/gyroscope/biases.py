"""Biases of the poses: their common value, how far the true bias changes, and what each pose then has."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.probability import chdtri


def pool_biases(bias: FloatArray, var_bias: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Random-effects mean of biases (n, 3) of variance (n, 3) (DerSimonian & Laird 1986).

    Returns the mean (3,), χ² against constancy (3,) with n − 1 degrees of freedom, and the variance (3,) of the true
    bias between poses, nothing where χ² is within chance.
    """
    floor = np.maximum(var_bias, 1e-30 + 1e-24 * bias**2)
    weight = 1.0 / floor
    total = weight.sum(axis=0)
    mean = (weight * bias).sum(axis=0) / total
    chi2 = (weight * (bias - mean) ** 2).sum(axis=0)
    dof = len(bias) - 1
    spread = np.maximum(chi2 - dof, 0.0) / np.maximum(total - (weight**2).sum(axis=0) / total, 1e-300)
    # Only a change beyond chance counts: a spread fitted to pure noise would spoil the weights of long poses.
    spread = np.where(chi2 > dof + 4.0 * np.sqrt(2.0 * max(dof, 1)), spread, 0.0)
    weight = 1.0 / (floor + spread)
    weight /= weight.sum(axis=0)
    return (weight * bias).sum(axis=0), chi2, spread


def excess_variance(values: FloatArray, noise: FloatArray) -> FloatArray:
    """Variance (3,) beyond ``noise`` (n, 3) in ``values`` (n, 3) about zero, from the median: deaf to single bad poses.

    Solves ``median(x²/(v + τ²)) = median of χ²(1)`` for τ² of each column; zero where noise alone explains the median.
    """
    target = float(chdtri(1, 0.5))
    out = np.zeros(values.shape[1])
    for axis, (x2, v) in enumerate(zip((values**2).T, noise.T, strict=True)):
        low, high = 0.0, float(np.max(x2)) / target
        if _median(x2 / np.maximum(v, 1e-300)) <= target:
            continue
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if _median(x2 / (v + middle)) > target else (low, middle)
        out[axis] = high
    return out


def _median(values: FloatArray) -> float:
    """As ``np.median`` of numbers; for some tens of them it takes six times as long as the sorting."""
    ordered, n = np.sort(values), len(values)
    return float(0.5 * (ordered[(n - 1) // 2] + ordered[n // 2]))


def shrink(bias: FloatArray, var_bias: FloatArray, mean: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Biases of the poses drawn to the session's by their noise: ``(z/v + z̄/τ²)/(1/v + 1/τ²)`` and its variance.

    With a bias that changes (τ² ≫ v) each pose keeps its own; with a steady one a short pose borrows from the others.
    """
    n = len(bias)
    tau2 = excess_variance((bias - mean) * np.sqrt(n / max(n - 1, 1)), var_bias)
    gain = tau2 / np.maximum(tau2 + var_bias, 1e-300)
    pooled = 1.0 / np.sum(1.0 / np.maximum(var_bias + tau2, 1e-300), axis=0)
    variance = gain * var_bias + (1.0 - gain) ** 2 * pooled
    return np.ascontiguousarray(mean + gain * (bias - mean)), np.ascontiguousarray(variance)
