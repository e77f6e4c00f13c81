"""Quantiles of the chi-square distribution for any real number of degrees of freedom."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri, gammainc

from trihedron.records.noise import FloatArray


def chi_square_quantile(probability: float, dof: FloatArray | float) -> FloatArray:
    """Value that a chi-square variate of ``dof`` degrees of freedom stays below with ``probability``."""
    return np.asarray(chdtri(np.asarray(dof, dtype=np.float64), 1.0 - probability))


def chi_square_probability(value: FloatArray | float, dof: FloatArray | float) -> FloatArray:
    """Probability that a chi-square variate of ``dof`` degrees of freedom stays below ``value``."""
    return np.asarray(gammainc(np.asarray(dof) / 2.0, np.asarray(value) / 2.0))
