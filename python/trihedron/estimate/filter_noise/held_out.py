"""Errors of a filter that carries on alone for some time, against what its covariance predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.filter_noise.stretch import Stretch


@dataclass(frozen=True, eq=False)
class Errors:
    """NEES of every start (n,) of one horizon, mean squares of error and prediction [SI²], starts apart."""

    nees: FloatArray
    actual: float
    predicted: float
    n_apart: int


def errors_over(stretches: Sequence[tuple[Stretch, int]], draws: FloatArray, horizon_s: float) -> Errors | None:
    """What lies ``horizon_s`` ahead, predicted from all before; of each stretch from block number ``first`` on.

    With V = L Lᵀ and w = L⁻¹y an observation j given those up to k is L[j, :k] w[:k], and its covariance is
    L[j, k:j] L[j, k:j]ᵀ: one factor holds the filter over every horizon. Strengths are known by ``draws`` (d, 7): means
    and covariances are those of the mixture. None where no start has room.
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
    """Errors (n, 3) and their covariances (n, 3, 3) under one set of strengths."""
    L, w = stretch.factor(strengths)
    errors, covariances = np.empty((len(targets), 3)), np.empty((len(targets), 3, 3))
    for k, j in enumerate(targets):
        known, last = 3 * (j - ahead + 1), 3 * j + 3
        left = L[last - 3 : last, known:last]
        errors[k], covariances[k] = left @ w[known:last], left @ left.T
    return errors, covariances
