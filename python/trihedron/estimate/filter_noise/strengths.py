"""Strengths of noise by evidence: their mode, draws of their posterior, and a bias that forgets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from trihedron.arrays import FloatArray
from trihedron.estimate.filter_noise.stretch import NAMES, Stretch

FARTHEST = 4.0
"""Strengths beyond four prior σ are strengths of nothing."""
STEP, CURVATURE_STEP = 0.02, 0.3
"""Steps in the logarithm of a strength for the slope, and for the curvature that the walk begins with."""
STEPS, LEARNED, THINNED = 900, 200, 10
"""Steps of the walk over strengths; the first 200 teach its size; every tenth of the others counts."""
TIMES_S = (10.0, 30.0, 100.0)
"""Time constants of a Gauss-Markov bias that are tried beside the walk."""
PREFERRED = 6.0
"""2 ln of the evidence by which the bias has to be Gauss-Markov: three time constants are tried (2 ln 3) and 4 more."""
ABSENT = 30.0
"""An interval that reaches over more than this factor says how large the strength can be, and no more."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Of the logarithms of the strengths: ``mean`` (8,), ``sigma`` (8,); ``is_there`` (8,) those that there are."""

    mean: FloatArray
    sigma: FloatArray
    is_there: FloatArray


@dataclass(frozen=True, eq=False)
class Fitted:
    """Likeliest strengths (8,) in SI with their log evidence, and draws (k, 8) of their posterior."""

    mode: FloatArray
    evidence: float
    draws: FloatArray


def most_likely(
    stretches: Sequence[Stretch], prior: Prior, start: FloatArray | None = None
) -> tuple[FloatArray, float]:
    """Logarithms (f,) of the strengths that the model has at their greatest posterior, and its logarithm there."""
    free = prior.is_there > 0.0
    first = prior.mean[free] if start is None else start
    low = prior.mean[free] - FARTHEST * prior.sigma[free]
    high = prior.mean[free] + FARTHEST * prior.sigma[free]

    def descent(x: FloatArray) -> tuple[float, FloatArray]:
        here = height(stretches, prior, x)
        return -here, np.array([(here - height(stretches, prior, x + STEP * e)) / STEP for e in np.eye(len(x))])

    bounds = list(zip(low, high, strict=True))
    found = minimize(
        descent, np.clip(first, low, high), jac=True, method="L-BFGS-B", bounds=bounds,
        options={"ftol": 1e-5, "maxiter": 50},
    )  # fmt: skip
    return np.asarray(found.x), -float(found.fun)


def height(stretches: Sequence[Stretch], prior: Prior, x: FloatArray) -> float:
    """Log posterior of logarithms (f,) of the strengths that the model has."""
    free = prior.is_there > 0.0
    far = (x - prior.mean[free]) / prior.sigma[free]
    strengths = whole(prior, x)
    return float(sum(one.evidence(strengths) for one in stretches) - 0.5 * far @ far)


def whole(prior: Prior, x: FloatArray) -> FloatArray:
    """(8,) strengths in SI; those that the model does not have are none."""
    out = np.zeros(len(NAMES))
    out[prior.is_there > 0.0] = np.exp(x)
    return out


def fit(stretches: Sequence[Stretch], prior: Prior, near: Fitted | None = None) -> Fitted:
    """Mode of the strengths and a Metropolis walk over their posterior; ``near`` is a fit of a part, to begin with."""
    free = prior.is_there > 0.0
    best, top = most_likely(stretches, prior, None if near is None else np.log(near.mode[free]))
    covariance = np.linalg.inv(_curvature(stretches, prior, best))
    if near is not None:
        covariance = 0.5 * np.cov(np.log(near.draws[:, free]).T) + 0.05 * covariance
    rng = np.random.default_rng(0)
    now, here = best, top
    seen: list[FloatArray] = []
    root = np.linalg.cholesky(covariance)
    for k in range(STEPS):
        if k == LEARNED:
            root = np.linalg.cholesky(0.9 * np.cov(np.array(seen).T) + 0.1 * covariance)
        other = now + 2.4 / np.sqrt(len(best)) * root @ rng.normal(size=len(best))
        far = np.abs(other - prior.mean[prior.is_there > 0.0]) / prior.sigma[prior.is_there > 0.0]
        there = -np.inf if np.any(far > FARTHEST) else height(stretches, prior, other)
        if np.log(rng.uniform()) < there - here:
            now, here = other, there
        seen.append(now)
    draws = np.array([whole(prior, x) for x in seen[LEARNED::THINNED]])
    return Fitted(whole(prior, best), top, draws)


def _curvature(stretches: Sequence[Stretch], prior: Prior, at: FloatArray) -> FloatArray:
    """Minus the second derivatives (f, f) along each axis alone, no flatter than the prior: a walk learns the rest."""
    here = height(stretches, prior, at)
    flat = 1.0 / prior.sigma[prior.is_there > 0.0] ** 2
    steps = CURVATURE_STEP * np.eye(len(at))
    both = [height(stretches, prior, at + e) + height(stretches, prior, at - e) for e in steps]
    curved = (2.0 * here - np.array(both)) / CURVATURE_STEP**2
    return np.diag(np.maximum(np.where(np.isfinite(curved), curved, flat), flat))


def forgetting(stretches: Sequence[Stretch], walk: Fitted) -> tuple[float, float, float]:
    """(2 ln gain, σ, time constant) of the best Gauss-Markov bias over the walk, the other strengths as they are."""
    at = NAMES.index("bias_walk")
    best = (-np.inf, 0.0, 0.0)
    for tau in TIMES_S:
        one = [stretch.with_gauss_markov(tau) for stretch in stretches]
        middle = walk.mode[at] * np.sqrt(0.5 * tau)
        for size in middle * np.geomspace(1.0 / 30.0, 30.0, 13):
            strengths = walk.mode.copy()
            strengths[at] = size
            found = sum(stretch.evidence(strengths) for stretch in one)
            best = max(best, (found, float(size), tau))
    base = sum(stretch.evidence(walk.mode) for stretch in stretches)
    return 2.0 * (best[0] - base), best[1], best[2]
