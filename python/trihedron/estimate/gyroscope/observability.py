"""Which parameters the moves determine, in words, with the moves to add."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.records.calibration import PARAMETER_NAMES, Observability
from trihedron.records.finding import Finding, FindingCode
from trihedron.records.words import Words, words

WEAK = 0.03
"""Relative standard uncertainty of a direction in ``S_ω`` above which it is weak: the accuracy of data sheets."""
HARDLY_SEEN = 10.0 * WEAK
"""Relative standard uncertainty above which a direction counts as not observable."""


def describe(covariance: FloatArray, S: FloatArray) -> Observability:
    """``Observability`` of ``S_ω`` (row by row) from its covariance (9, 9).

    A move shows ``δS_ω ∫w' dt`` only across the vertical: the element ``S_ij`` needs a rotation about body axis ``j``
    during which axis ``i`` is not vertical, and, for ``i ≠ j``, by an angle that is not a multiple of 360°.
    """
    scale = np.maximum(np.linalg.norm(S, axis=0), np.finfo(float).tiny)
    share = np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(3, 3) / scale
    rate, axis = (int(k) for k in np.unravel_index(np.argmax(share), (3, 3)))
    weakest = words("gyro-scale" if rate == axis else "gyro-share", axis=axis + 1, rate=rate + 1)
    sigma = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(sigma, sigma)
    pairs = tuple(
        (PARAMETER_NAMES[i], PARAMETER_NAMES[j], float(correlation[i, j]))
        for i in range(9)
        for j in range(i + 1, 9)
        if abs(correlation[i, j]) > 0.9
    )
    size = max(float(np.linalg.norm(S, 2)), np.finfo(float).tiny)
    singular = size / np.sqrt(np.maximum(np.linalg.eigvalsh(covariance), 1e-300))
    # The fit has a prior as wide as the scale: below √2 the moves add less information than the prior.
    rank = int(np.count_nonzero(singular > np.sqrt(2.0)))
    condition = float(singular[0] / singular[-1]) if rank == 9 else float("inf")
    is_weak = rank < 9 or _worst(covariance, S) > WEAK
    advice = tuple(_advice(covariance, size, rank)) if is_weak else ()
    return Observability(rank, 9, condition, singular, weakest, advice, pairs)


def _worst(covariance: FloatArray, S: FloatArray) -> float:
    """Standard uncertainty of the least determined direction in ``S_ω``, relative to its norm."""
    size = float(np.linalg.norm(S, 2))
    return float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0))) / size if size > 0 else float("inf")


def _advice(covariance: FloatArray, size: float, rank: int) -> list[Words]:
    lines = []
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0)).reshape(3, 3) / size
    for axis in range(3):
        weak = [rate for rate in range(3) if sigma[rate, axis] > WEAK]
        if not weak:
            continue
        # The element S_ij is observable while axis i is horizontal: start with the third axis vertical.
        across = next((rate for rate in weak if rate != axis), axis)
        lines.append(
            words(
                "turn-about",
                axis=axis + 1,
                start=len(weak) < 3 and across != axis,
                upright=3 - axis - across + 1,
                is_twice=len(weak) == 3,
            )
        )
    if not lines and rank < 9:
        lines.append(words("moves-about-all"))
    return lines


def observability_findings(observability: Observability, covariance: FloatArray, S: FloatArray) -> list[Finding]:
    """NOT_OBSERVABLE or WEAKLY_OBSERVABLE with the moves to add, or an empty list."""
    advice = observability.advice
    missing = observability.n_parameters - observability.rank
    if missing > 0:
        return [
            Finding.of(
                FindingCode.NOT_OBSERVABLE,
                "moves-rank",
                rank=observability.rank,
                n_parameters=observability.n_parameters,
                weakest=observability.weakest,
                advice=advice,
            )
        ]
    worst = _worst(covariance, S)
    if worst > HARDLY_SEEN:
        return [Finding.of(FindingCode.NOT_OBSERVABLE, "moves-weak", weakest=observability.weakest, advice=advice)]
    if worst > WEAK:
        return [Finding.of(FindingCode.WEAKLY_OBSERVABLE, "moves", weakest=observability.weakest, advice=advice)]
    return []
