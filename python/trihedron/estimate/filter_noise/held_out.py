"""Errors of a filter without updates over a horizon, against the covariance that it predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.filter_noise.stretch import Stretch


@dataclass(frozen=True, eq=False)
class Errors:
    """NEES (n,) of all starts, mean squares of actual and predicted error [SI²], number of starts without overlap."""

    nees: FloatArray
    actual: float
    predicted: float
    n_apart: int


def errors_over(stretches: Sequence[tuple[Stretch, int]], draws: FloatArray, horizon_s: float) -> Errors | None:
    """Prediction errors ``horizon_s`` ahead from all earlier observations; of each stretch from block ``first`` on.

    With V = L Lᵀ and w = L⁻¹y the prediction of observation j from those up to k is L[j, :k] w[:k], its covariance
    L[j, k:j] L[j, k:j]ᵀ: one factor gives the filter over every horizon. Means and covariances are those of the mixture
    over ``draws`` (d, 7) of the strengths. None where no stretch is long enough.
    """
    nees, actual, predicted, apart = [], [], [], 0
    for stretch, first in stretches:
        step_s = float(np.median(np.diff(stretch.time_s)))
        ahead = max(1, round(horizon_s / step_s))
        targets = np.arange(max(first, ahead + 2) + ahead - 1, len(stretch.time_s))
        if not len(targets):
            continue
        apart += -(-len(targets) // ahead)
        every = [_ahead(stretch, strengths, ahead, targets) for strengths in draws]
        errors = np.array([error for error, _ in every])
        middle = errors.mean(axis=0)
        apart_of = errors - middle
        covariance = np.mean([cov for _, cov in every], axis=0) + np.einsum("dni,dnj->nij", apart_of, apart_of) / len(
            draws
        )
        nees += list(np.einsum("ni,ni->n", middle, np.linalg.solve(covariance, middle[:, :, None])[:, :, 0]))
        actual += list(np.sum(middle**2, axis=1))
        predicted += list(np.trace(covariance, axis1=1, axis2=2))
    if not nees:
        return None
    return Errors(np.array(nees), float(np.mean(actual)), float(np.mean(predicted)), apart)


def _ahead(stretch: Stretch, strengths: FloatArray, ahead: int, targets: np.ndarray) -> tuple[FloatArray, FloatArray]:
    """Errors (n, 3) of the blocks ``targets`` (n,) and their covariances (n, 3, 3) under one set of strengths."""
    L, w = stretch.factor(strengths)
    errors, covariances = np.empty((len(targets), 3)), np.empty((len(targets), 3, 3))
    for k, j in enumerate(targets):
        known, last = 3 * (j - ahead + 1), 3 * j + 3
        left = L[last - 3 : last, known:last]
        errors[k], covariances[k] = left @ w[known:last], left @ left.T
    return errors, covariances
