"""Gyro biases of the poses: their mean, their variance between poses, and the combined estimate for each pose."""

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.estimate.known_vectors import KnownVectors, fit_known
from trihedron.probability import MEDIAN_CHI2, fdtrc

FALSE_ALARM = 1e-4
"""Probability that g-sensitivity is removed from a sensor without it; the cost of removing a spurious one is small."""


@dataclass(frozen=True, eq=False)
class AttitudeDependence:
    """``z(f) = z₀ + A f``: the raw bias (n, 3) of the poses against their specific force.

    ``A`` (3, 3) in raw unit per m/s²; ``var_bias`` (3,) variances of ``z₀``; ``p_value`` of ``A = 0``;
    ``scatter_left`` the ratio of the scatter of the pose biases with ``A`` to that without.
    """

    A: FloatArray
    var_bias: FloatArray
    p_value: float
    scatter_left: float

    @property
    def is_present(self) -> bool:
        """Whether the dependence is significant at ``FALSE_ALARM``."""
        return self.p_value < FALSE_ALARM


def attitude_dependence(zero: FloatArray, var_bias: FloatArray, force: FloatArray) -> AttitudeDependence | None:
    """Regress the pose biases on specific force (n, 3), m/s²; ``None`` with fewer than 9 poses or poses in one plane.

    One F test for the three axes: 9 slopes against 3 (n - 4) residual degrees of freedom.
    """
    n = len(zero)
    design = np.column_stack([np.ones(n), force])
    if n < 9 or np.linalg.matrix_rank(design, tol=1e-2 * float(np.linalg.norm(force, 2))) < 4:
        return None
    var_bias = np.maximum(var_bias, 1e-30 + 1e-24 * zero**2)
    rows = KnownVectors(zero, force, np.ones(n), var_bias[:, :, None] * np.eye(3), np.zeros((n, 3, 0)))
    fit = fit_known(rows)
    mean = np.average(zero, axis=0, weights=1.0 / var_bias)
    chi2_mean, chi2_line = float(np.sum((zero - mean) ** 2 / var_bias)), fit.chi2
    per_dof = np.sum(rows.residual(fit.S_a, fit.b_a) ** 2 / var_bias, axis=0) / (n - 4)
    var_z0 = np.diag(fit.covariance)[9:] * np.maximum(per_dof, 1.0)
    ratio = ((chi2_mean - chi2_line) / 9.0) / max(chi2_line / (3.0 * (n - 4)), TINY)
    # Where noise alone explains the pose biases, the ratio of two small sums is not tested.
    p_value = float(fdtrc(9, 3 * (n - 4), ratio)) if chi2_mean > 3.0 * (n - 1) else 1.0
    left = float(np.sqrt(chi2_line / (n - 4) / max(chi2_mean / (n - 1), TINY)))
    return AttitudeDependence(fit.S_a, var_z0, p_value, left)


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
