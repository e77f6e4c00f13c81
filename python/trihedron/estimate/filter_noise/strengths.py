"""Strengths of noise by evidence: draws of their posterior, and a bias that forgets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize
from scipy.special import gammaln, logsumexp, ndtr

from trihedron.arrays import FloatArray
from trihedron.estimate.filter_noise.stretch import NAMES, Stretch

COORDINATES = ("noise", "vibration", "bias_walk", "white", "slow", "slow_s", "body")
"""Logarithms of strengths, ``slow`` that of the reference's whole slow error, and last a standard normal number whose
quantile is the part of its square that turns with the body: two strengths of which either may be nothing would have a
posterior with a corner."""
FARTHEST = 4.0
"""Coordinates beyond four prior σ are those of nothing."""
STEP, CURVATURE_STEP = 0.02, 0.3
"""Steps in a coordinate for the slope, and for the curvature that sampling begins with."""
LOWEST = -1e7
"""Stands for the log posterior where a covariance is singular."""
ROUNDS, PROPOSED, DRAWN = 6, 100, 400
"""Rounds of proposals, proposals of each, and draws that are made of them."""
LEAST_DRAWS = 3
"""Independent draws for each strength below which their covariance is too narrow, or singular, to propose from."""
TAILS = 5.0
"""Degrees of freedom of a proposal: heavier tails than a posterior's."""
TIMES_S = (10.0, 30.0, 100.0)
"""Time constants of a Gauss-Markov bias that are tried beside the walk."""
PREFERRED = 6.0
"""2 ln of the evidence by which the bias has to be Gauss-Markov: three time constants are tried (2 ln 3) and 4 more."""
ABSENT = 30.0
"""An interval that reaches over more than this factor says how large the strength can be, and no more."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Of the coordinates: ``mean`` (7,), ``sigma`` (7,); ``is_there`` (7,) those that there are."""

    mean: FloatArray
    sigma: FloatArray
    is_there: FloatArray


@dataclass(frozen=True, eq=False)
class Fitted:
    """Likeliest strengths (7,) in SI, log evidence of the model, draws (k, 7) of the strengths' posterior, the same as
    coordinates (k, f), and of how many independent ones those are worth."""

    mode: FloatArray
    evidence: float
    draws: FloatArray
    coordinates: FloatArray
    n_effective: float


def most_likely(stretches: Sequence[Stretch], prior: Prior) -> FloatArray:
    """(f,) coordinates that the model has, at their greatest posterior."""
    free = prior.is_there > 0.0
    low = prior.mean[free] - FARTHEST * prior.sigma[free]
    high = prior.mean[free] + FARTHEST * prior.sigma[free]

    def descent(x: FloatArray) -> tuple[float, FloatArray]:
        # Line search turns back from a wall, not from infinity.
        here = max(height(stretches, prior, x), LOWEST)
        there = [max(height(stretches, prior, x + STEP * e), LOWEST) for e in np.eye(len(x))]
        return -here, (here - np.array(there)) / STEP

    found = minimize(
        descent, prior.mean[free], jac=True, method="L-BFGS-B", bounds=list(zip(low, high, strict=True)),
        options={"ftol": 1e-5, "maxiter": 50},
    )  # fmt: skip
    return np.asarray(found.x)


def height(stretches: Sequence[Stretch], prior: Prior, x: FloatArray) -> float:
    """Log posterior of coordinates (f,) that the model has, up to the prior's norm."""
    free = prior.is_there > 0.0
    far = (x - prior.mean[free]) / prior.sigma[free]
    if np.any(np.abs(far) > FARTHEST + STEP):
        return -np.inf
    strengths = whole(prior, x)
    return float(sum(one.evidence(strengths) for one in stretches) - 0.5 * far @ far)


def whole(prior: Prior, x: FloatArray) -> FloatArray:
    """(7,) strengths in SI of coordinates (f,); those that the model does not have are none."""
    every = np.full(len(COORDINATES), -np.inf)
    every[prior.is_there > 0.0] = x
    body = float(ndtr(every[-1]))
    slow = np.exp(every[4])
    return np.array([*np.exp(every[:4]), slow * np.sqrt(1.0 - body), slow * np.sqrt(body), np.exp(every[5])])


def fit(stretches: Sequence[Stretch], prior: Prior, near: Fitted | None = None) -> Fitted:
    """Posterior of the strengths by importance: each round's proposals are Student's with the moments of all before,
    and every proposal counts against the mixture of all rounds (Cornuet et al. 2012); ``near`` is a fit of a part.
    """
    if near is None or near.n_effective < LEAST_DRAWS * near.coordinates.shape[1]:
        middle = most_likely(stretches, prior)
        first = np.linalg.inv(_curvature(stretches, prior, middle))
    else:
        middle, first = near.coordinates.mean(axis=0), np.cov(near.coordinates.T)
    rng = np.random.default_rng(0)
    spread, proposals = first, []
    x, heights = np.empty((0, len(middle))), np.empty(0)
    for _ in range(ROUNDS):
        root = np.linalg.cholesky(spread)
        proposals.append((middle, root))
        widths = np.sqrt(TAILS / rng.chisquare(TAILS, size=(PROPOSED, 1)))
        new = middle + widths * rng.normal(size=(PROPOSED, len(middle))) @ root.T
        x = np.vstack([x, new])
        heights = np.append(heights, [height(stretches, prior, one) for one in new])
        logs = heights - _mixture(x, proposals)
        weights = np.exp(logs - logs.max())
        weights /= weights.sum()
        # Few that count would make the next proposal too narrow: flatter weights until there are enough.
        flat = weights if _effective(weights) > LEAST_DRAWS * len(middle) else np.sqrt(weights) / np.sqrt(weights).sum()
        middle = flat @ x
        spread = ((x - middle).T * flat) @ (x - middle) + 0.02 * first
    norm = 0.5 * len(middle) * np.log(2.0 * np.pi) + np.sum(np.log(prior.sigma[prior.is_there > 0.0]))
    evidence = float(logs.max() + np.log(np.mean(np.exp(logs - logs.max()))) - norm)
    chosen = np.searchsorted(np.cumsum(weights), (np.arange(DRAWN) + 0.5) / DRAWN).clip(max=len(x) - 1)
    draws = np.array([whole(prior, one) for one in x[chosen]])
    return Fitted(whole(prior, x[np.argmax(heights)]), evidence, draws, x[chosen], _effective(weights))


def _effective(weights: FloatArray) -> float:
    return float(1.0 / np.sum(weights**2))


def _mixture(x: FloatArray, proposals: Sequence[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """(k,) log density of points (k, f) under the mean of Student's distributions, by middle and root."""
    n = x.shape[1]
    norm = gammaln(0.5 * (TAILS + n)) - gammaln(0.5 * TAILS) - 0.5 * n * np.log(TAILS * np.pi)
    each = []
    for middle, root in proposals:
        far = np.sum(solve_triangular(root, (x - middle).T, lower=True) ** 2, axis=0)
        each.append(norm - np.sum(np.log(np.diag(root))) - 0.5 * (TAILS + n) * np.log1p(far / TAILS))
    return np.asarray(logsumexp(each, axis=0) - np.log(len(proposals)))


def _curvature(stretches: Sequence[Stretch], prior: Prior, at: FloatArray) -> FloatArray:
    """Minus the second derivatives (f, f) along each axis, no flatter than the prior: sampling learns the rest."""
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
