"""Strengths of noise by evidence: draws of their posterior, and a bias that forgets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.special import gammaln, logsumexp, ndtr, ndtri, stdtrit

from trihedron.arrays import FloatArray
from trihedron.estimate.filter_noise.stretch import NAMES, Stretch
from trihedron.records.filter_noise import Bounded

Mask = npt.NDArray[np.bool_]

COORDINATES = ("noise", "vibration", "bias_walk", "white", "slow", "slow_s", "body")
"""Logarithms of strengths, ``slow`` that of the reference's whole slow error, and last a standard normal number whose
quantile is the angle, in right angles, between it and its part in the world: two strengths of which either may be
nothing would have a posterior with a corner. The ratio of the two is then half-Cauchy; with the quantile as the part of
the *square* that turns with the body, none of it was so unlikely that the whole came out too small."""
MAY_BE_NOTHING = np.isin(COORDINATES, ("vibration", "bias_walk", "white", "slow"))
NU = 3.0
"""Degrees of freedom of its prior, the fewest with a mean square: a predicted covariance is one."""
MEDIAN = float(np.log(stdtrit(NU, 0.75)))
"""Logarithm of its median for scale one: that is where the usual size stands."""
HALF = float(np.log(2.0) + gammaln(0.5 * NU + 0.5) - gammaln(0.5 * NU) - 0.5 * np.log(np.pi * NU))
FARTHEST = 4.0
"""Coordinates beyond four prior σ are those of nothing."""
STEP = 1e-3
"""Step in a coordinate for derivatives of the covariance."""
SEARCHES, LONGEST_STEP, ENOUGH = 80, 2.0, 0.01
"""Steps of the search, the longest of them, and the gain of the log posterior at which it ends."""
ROUNDS, MOST_ROUNDS, PROPOSED, DRAWN = 3, 15, 100, 400
"""Rounds of proposals at least and at most, proposals of each, and draws that are made of them."""
LEAST_DRAWS, ENOUGH_DRAWS = 3, 15
"""Independent draws for each strength below which their covariance is too narrow, or singular, to propose from, and
with which sampling may end."""
TAILS = 5.0
"""Degrees of freedom of a proposal: heavier tails than a posterior's."""
TIMES_S = (10.0, 30.0, 100.0)
"""Time constants of a Gauss-Markov bias that are tried beside the walk."""
PREFERRED = 6.0
"""2 ln of the evidence by which the bias has to be Gauss-Markov: three time constants are tried (2 ln 3) and 4 more."""
WIDER_BY, LEAST_SIGMA = 2.0, 0.2
"""Prior σ of what another sensor's draws tell, in theirs: both see the same course of the reference's error, and what
that course tells of its strength counts once. No less than the number of draws tells."""
ABSENT = 30.0
"""An interval that reaches over more than this factor says how large the strength can be, and no more."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Of the coordinates: ``mean`` (7,), ``sigma`` (7,); ``is_there`` (7,) those that there are.

    A strength that ``may_be_nothing`` (7,) has half a Student's distribution of that median (Gelman 2006): flat towards
    nothing, so that what a log does not show has an upper limit of the log and not of the prior. ``sigma`` then bounds
    the search. The others are normal.
    """

    mean: FloatArray
    sigma: FloatArray
    is_there: FloatArray
    may_be_nothing: Mask = field(default_factory=MAY_BE_NOTHING.copy)


@dataclass(frozen=True, eq=False)
class Fitted:
    """Likeliest strengths (7,) in SI, log evidence of the model, draws (k, 7) of the strengths' posterior, and of how
    many independent ones those are worth."""

    mode: FloatArray
    evidence: float
    draws: FloatArray
    n_effective: float

    @property
    def is_settled(self) -> bool:
        """Whether enough draws count for moments of the strengths."""
        return bool(self.n_effective > LEAST_DRAWS * np.count_nonzero(np.ptp(self.draws, axis=0)))


def most_likely(stretches: Sequence[Stretch], prior: Prior) -> tuple[FloatArray, FloatArray]:
    """Coordinates (f,) that the model has at their greatest posterior, and its information (f, f) there.

    Steps of Levenberg and Marquardt with the average information: the posterior has ridges along which a search that
    knows only slopes stops early.
    """
    free = prior.is_there > 0.0
    reach = (FARTHEST - 0.1) * prior.sigma[free]
    x = prior.mean[free]
    here = height(stretches, prior, x)
    slope, information = _slope(stretches, prior, x)
    damping = 0.1
    for _ in range(SEARCHES):
        step = np.linalg.solve(information + damping * np.diag(np.diag(information)), slope)
        step *= min(1.0, LONGEST_STEP / float(np.max(np.abs(step))))
        tried = np.clip(x + step, prior.mean[free] - reach, prior.mean[free] + reach)
        there = height(stretches, prior, tried)
        if there > here:
            gain, x, here, damping = there - here, tried, there, damping / 5.0
            slope, information = _slope(stretches, prior, x)
            if gain < ENOUGH:
                break
        elif damping > 1e8:
            break
        else:
            damping = max(5.0 * damping, 1e-3)
    return x, information


def _slope(stretches: Sequence[Stretch], prior: Prior, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derivatives (f,) of the log posterior, and its average information (f, f; Gilmour et al. 1995)."""
    free = prior.is_there > 0.0
    far, sigma = x - prior.mean[free], prior.sigma[free]
    # Of the logarithm, on average over the prior.
    slope = np.where(prior.may_be_nothing[free], _half_slope(far), -far / sigma**2)
    information = np.diag(np.where(prior.may_be_nothing[free], 2.0 * NU / (NU + 3.0), 1.0 / sigma**2))
    at = whole(prior, x)
    others = [whole(prior, x + STEP * e) for e in np.eye(len(x))]
    for one in stretches:
        V = one.covariance(at)
        y = one.observed - one.columns @ one.centre
        inverse = cho_solve(cho_factor(V + one.columns @ one.columns.T, lower=True), np.eye(len(y)))
        weighed = inverse @ y
        carried = []
        for k, other in enumerate(others):
            change = (one.covariance(other) - V) / STEP
            carried.append(change @ weighed)
            slope[k] += 0.5 * (weighed @ carried[k] - np.sum(inverse * change))
        information += 0.5 * np.array(carried) @ inverse @ np.array(carried).T
    return slope, information


def _half_slope(far: FloatArray) -> FloatArray:
    """Derivative of the logarithm of half a Student's density."""
    return np.asarray(1.0 - (NU + 1.0) / (1.0 + NU * np.exp(-2.0 * (far + MEDIAN))))


def height(stretches: Sequence[Stretch], prior: Prior, x: FloatArray) -> float:
    """Log evidence and prior of coordinates (f,) that the model has."""
    free = prior.is_there > 0.0
    far, sigma = x - prior.mean[free], prior.sigma[free]
    if np.any(np.abs(far) > (FARTHEST + STEP) * sigma):
        return -np.inf
    strengths = whole(prior, x)
    normal = -0.5 * (far / sigma) ** 2 - np.log(np.sqrt(2.0 * np.pi) * sigma)
    half = HALF + far + MEDIAN - 0.5 * (NU + 1.0) * np.log1p(np.exp(2.0 * (far + MEDIAN)) / NU)
    known = np.sum(np.where(prior.may_be_nothing[free], half, normal))
    return float(sum(one.evidence(strengths) for one in stretches) + known)


def whole(prior: Prior, x: FloatArray) -> FloatArray:
    """(7,) strengths in SI of coordinates (f,); those that the model does not have are none."""
    every = np.full(len(COORDINATES), -np.inf)
    every[prior.is_there > 0.0] = x
    angle = 0.5 * np.pi * float(ndtr(every[-1]))
    slow = np.exp(every[4])
    return np.array([*np.exp(every[:4]), slow * np.cos(angle), slow * np.sin(angle), np.exp(every[5])])


def with_slow_error_of(prior: Prior, draws: FloatArray) -> Prior:
    """The prior of another sensor beside the same reference, whose slow error is as ``draws`` (k, 7) of this one have
    it: one error turns the angles of the one and tilts gravity for the other."""
    s = dict(zip(NAMES, draws.T, strict=True))
    right_angles = np.arctan2(s["body"], s["world"]) / (0.5 * np.pi)
    told = {
        "slow": np.log(np.hypot(s["world"], s["body"])),
        "slow_s": np.log(s["slow_s"]),
        # Within five sigma: rounding makes a part of the one or of the other exactly nothing.
        "body": np.clip(ndtri(right_angles), -5.0, 5.0),
    }
    mean, sigma, may_be_nothing = prior.mean.copy(), prior.sigma.copy(), prior.may_be_nothing.copy()
    for name, values in told.items():
        at = COORDINATES.index(name)
        mean[at], sigma[at], may_be_nothing[at] = values.mean(), max(WIDER_BY * float(values.std()), LEAST_SIGMA), False
    return replace(prior, mean=mean, sigma=sigma, may_be_nothing=may_be_nothing)


def fit(stretches: Sequence[Stretch], prior: Prior) -> Fitted:
    """Posterior of the strengths by importance: each round's proposals are Student's with the moments of all before,
    and every proposal counts against the mixture of all rounds (Cornuet et al. 2012).
    """
    middle, information = most_likely(stretches, prior)
    first = np.linalg.inv(information)
    rng = np.random.default_rng(0)
    spread, proposals = first, []
    x, heights = np.empty((0, len(middle))), np.empty(0)
    for drawn in range(1, MOST_ROUNDS + 1):
        root = np.linalg.cholesky(spread)
        proposals.append((middle, root))
        widths = np.sqrt(TAILS / rng.chisquare(TAILS, size=(PROPOSED, 1)))
        new = middle + widths * rng.normal(size=(PROPOSED, len(middle))) @ root.T
        x = np.vstack([x, new])
        heights = np.append(heights, [height(stretches, prior, one) for one in new])
        logs = heights - _mixture(x, proposals)
        weights = np.exp(logs - logs.max())
        weights /= weights.sum()
        if drawn >= ROUNDS and _effective(weights) > ENOUGH_DRAWS * len(middle):
            break
        # Few that count would make the next proposal too narrow: flatter weights until there are enough.
        flat = weights if _effective(weights) > LEAST_DRAWS * len(middle) else np.sqrt(weights) / np.sqrt(weights).sum()
        middle = flat @ x
        spread = ((x - middle).T * flat) @ (x - middle) + 0.02 * first
    evidence = float(logs.max() + np.log(np.mean(np.exp(logs - logs.max()))))
    chosen = np.searchsorted(np.cumsum(weights), (np.arange(DRAWN) + 0.5) / DRAWN).clip(max=len(x) - 1)
    draws = np.array([whole(prior, one) for one in x[chosen]])
    return Fitted(whole(prior, x[np.argmax(heights)]), evidence, draws, _effective(weights))


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


def bounded(values: Sequence[float] | FloatArray) -> Bounded:
    """Median and 95 % interval of draws; only a limit where the interval reaches over a factor of ``ABSENT``."""
    low, middle, high = (float(v) for v in np.quantile(values, [0.025, 0.5, 0.975]))
    is_limit = high > 0.0 and low < high / ABSENT
    return Bounded(middle, 0.0 if is_limit else low, high, is_limit)


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
