"""Gyro biases of the poses: their mean, their variance between poses, and the combined estimate for each pose."""

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.probability import MEDIAN_CHI2


def pool_biases(bias: FloatArray, var_bias: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Random-effects mean of biases (n, 3) of variance (n, 3) (DerSimonian & Laird 1986).

    Returns the mean (3,), χ² against constancy (3,) with n − 1 degrees of freedom, and the variance (3,) of the true
    bias between poses, 0 where χ² is within chance.
    """
    floor = np.maximum(var_bias, 1e-30 + 1e-24 * bias**2)
    weight = 1.0 / floor
    total = weight.sum(axis=0)
    mean = (weight * bias).sum(axis=0) / total
    chi2 = (weight * (bias - mean) ** 2).sum(axis=0)
    dof = len(bias) - 1
    spread = np.maximum(chi2 - dof, 0.0) / np.maximum(total - (weight**2).sum(axis=0) / total, TINY)
    # Only a significant spread counts: one fitted to noise alone would reduce the weights of long poses.
    spread = np.where(chi2 > dof + 4.0 * np.sqrt(2.0 * max(dof, 1)), spread, 0.0)
    weight = 1.0 / (floor + spread)
    weight /= weight.sum(axis=0)
    return (weight * bias).sum(axis=0), chi2, spread


def shrink(bias: FloatArray, var_bias: FloatArray, mean: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Biases of the poses combined with the session's mean: ``(z/v + z̄/τ²)/(1/v + 1/τ²)`` and its variance.

    Where the bias changes between poses (τ² ≫ v) each pose keeps its own; a constant bias is estimated from all poses.
    """
    n = len(bias)
    # Medians are robust to single bad poses.
    square = np.median((bias - mean) ** 2, axis=0) * n / max(n - 1, 1) / MEDIAN_CHI2[1]
    tau2 = np.maximum(square - np.median(var_bias, axis=0), 0.0)
    gain = tau2 / np.maximum(tau2 + var_bias, TINY)
    pooled = 1.0 / np.sum(1.0 / np.maximum(var_bias + tau2, TINY), axis=0)
    variance = gain * var_bias + (1.0 - gain) ** 2 * pooled
    return np.ascontiguousarray(mean + gain * (bias - mean)), np.ascontiguousarray(variance)
