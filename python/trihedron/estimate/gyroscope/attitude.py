"""A bias that follows gravity (g-sensitivity): found in the poses, removed from the moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.probability import fdtrc

FALSE_ALARM = 1e-4
"""Chance that a sensor without it is treated for it: the price of removing nothing is small, but it is a decision."""


@dataclass(frozen=True, eq=False)
class AttitudeDependence:
    """``z(f) = z₀ + A f``: the raw bias (n, 3) of the poses against their specific force.

    ``A`` (3, 3) in raw unit per m/s²; ``zero`` (3,) is ``z₀`` with ``cov_bias`` variances (3,); ``p_value`` of ``A =
    0``; ``scatter_before``, ``scatter_after`` (3,) the standard deviation of the pose biases without and with it, raw.
    """

    A: FloatArray
    bias: FloatArray
    var_bias: FloatArray
    p_value: float
    scatter_left: float

    @property
    def is_present(self) -> bool:
        """The holds say so beyond chance."""
        return self.p_value < FALSE_ALARM


def attitude_dependence(bias: FloatArray, var_bias: FloatArray, force: FloatArray) -> AttitudeDependence | None:
    """Regress the pose biases on specific force (n, 3), m/s²; ``None`` with fewer than 9 poses or poses in one plane.

    The three axes share one F test: 9 slopes against what is left of 3 n numbers.
    """
    n = len(bias)
    design = np.column_stack([np.ones(n), force])
    if n < 9 or np.linalg.matrix_rank(design, tol=1e-2 * float(np.linalg.norm(force, 2))) < 4:
        return None
    A, z0, var_z0 = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    chi2_mean = chi2_line = 0.0
    for axis in range(3):
        weight = 1.0 / np.maximum(var_bias[:, axis], 1e-30 + 1e-24 * bias[:, axis] ** 2)
        root = np.sqrt(weight)
        mean = float(np.average(bias[:, axis], weights=weight))
        solution, *_ = np.linalg.lstsq(design * root[:, None], bias[:, axis] * root, rcond=None)
        rest = bias[:, axis] - design @ solution
        mean_square = float(np.sum(weight * rest**2)) / (n - 4)
        covariance = np.linalg.inv((design * weight[:, None]).T @ design) * max(mean_square, 1.0)
        z0[axis], A[axis], var_z0[axis] = solution[0], solution[1:], covariance[0, 0]
        chi2_mean += float(np.sum(weight * (bias[:, axis] - mean) ** 2))
        chi2_line += float(np.sum(weight * rest**2))
    ratio = ((chi2_mean - chi2_line) / 9.0) / max(chi2_line / (3.0 * (n - 4)), 1e-300)
    # Where noise alone explains the poses, a significant ratio of two tiny numbers means nothing.
    p_value = float(fdtrc(9, 3 * (n - 4), ratio)) if chi2_mean > 3.0 * (n - 1) else 1.0
    left = float(np.sqrt(chi2_line / (n - 4) / max(chi2_mean / (n - 1), 1e-300)))
    return AttitudeDependence(A, z0, var_z0, p_value, left)
