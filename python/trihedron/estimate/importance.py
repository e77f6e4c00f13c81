"""Draws of a posterior of a few coordinates by adaptive importance sampling (Cornuet et al. 2012)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln, logsumexp

from trihedron.arrays import FloatArray
from trihedron.threads import side_by_side

ROUNDS, MOST_ROUNDS, PROPOSED = 3, 15, 100
"""Fewest and most rounds of proposals, proposals per round."""
LEAST_DRAWS = 3
"""Effective draws per coordinate below which their covariance is too narrow, or singular, for proposals."""
TAILS = 5
"""Degrees of freedom of a proposal: heavier tails than the posterior's."""


@dataclass(frozen=True, eq=False)
class Drawn:
    """All proposals (k, f) with their weights (k,) and log densities (k,), and the log of the density's integral."""

    points: FloatArray
    weights: FloatArray
    heights: FloatArray
    evidence: float

    @property
    def n_effective(self) -> float:
        """Effective number of draws."""
        return float(1.0 / np.sum(self.weights**2))

    def chosen(self, n: int) -> FloatArray:
        """(n, f) draws of equal weight."""
        at = np.searchsorted(np.cumsum(self.weights), (np.arange(n) + 0.5) / n)
        return np.asarray(self.points[at.clip(max=len(self.points) - 1)])


def drawn_from(
    log_density: Callable[[FloatArray], float], middle: FloatArray, spread: FloatArray, enough: float
) -> Drawn:
    """Draws until ``enough`` of them are effective, from proposals about ``middle`` (f,) with covariance ``spread``.

    Each round proposes from Student's distribution with the moments of all earlier draws; weights are against the
    mixture of all rounds.
    """
    rng = np.random.default_rng(0)
    first, proposals = spread, []
    found = Drawn(np.empty((0, len(middle))), np.empty(0), np.empty(0), -np.inf)
    for drawn in range(1, MOST_ROUNDS + 1):
        root = np.asarray(np.linalg.cholesky(spread), dtype=np.float64)
        proposals.append((middle, root))
        widths = np.sqrt(TAILS / rng.chisquare(TAILS, size=(PROPOSED, 1)))
        new = middle + widths * rng.normal(size=(PROPOSED, len(middle))) @ root.T
        points = np.vstack([found.points, new])
        heights = np.append(found.heights, side_by_side(log_density, new))
        logs = heights - _mixture(points, proposals)
        weights = np.exp(logs - logs.max())
        found = Drawn(points, weights / weights.sum(), heights, float(logs.max() + np.log(np.mean(weights))))
        if drawn >= ROUNDS and found.n_effective > enough:
            break
        # Too few effective draws make the next proposal too narrow: the weights are flattened until there are enough.
        is_enough = found.n_effective > LEAST_DRAWS * len(middle)
        flat = found.weights if is_enough else np.sqrt(found.weights) / np.sqrt(found.weights).sum()
        middle = flat @ points
        spread = ((points - middle).T * flat) @ (points - middle) + 0.02 * first
    return found


def _mixture(x: FloatArray, proposals: Sequence[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """(k,) log density of points (k, f) under the equal mixture of Student's distributions (mean, Cholesky root)."""
    n = x.shape[1]
    constant = gammaln(0.5 * (TAILS + n)) - gammaln(0.5 * TAILS) - 0.5 * n * np.log(TAILS * np.pi)
    each = []
    for middle, root in proposals:
        far = np.sum(np.linalg.solve(root, (x - middle).T) ** 2, axis=0)
        each.append(constant - 0.5 * (TAILS + n) * np.log1p(far / TAILS) - np.sum(np.log(np.diag(root))))
    return np.asarray(logsumexp(each, axis=0) - np.log(len(proposals)))
