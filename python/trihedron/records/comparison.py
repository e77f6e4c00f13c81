"""An estimate against the truth, where a simulation knows it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Comparison:
    """Every free parameter: ``names`` (k), ``truth``, ``estimate``, ``sigma`` (k,), ``covariance`` (k, k)."""

    names: tuple[str, ...]
    truth: FloatArray
    estimate: FloatArray
    sigma: FloatArray
    covariance: FloatArray

    @property
    def z(self) -> FloatArray:
        """(k,) errors in standard errors: standard normal when the uncertainties are honest."""
        z: FloatArray = (self.estimate - self.truth) / self.sigma
        return z

    @property
    def chi2(self) -> float:
        """Squared error in the metric of the whole covariance; its mean is the number of parameters."""
        error = self.estimate - self.truth
        return float(error @ np.linalg.solve(self.covariance, error))
