"""Noise strengths by evidence: draws of their posterior, and a comparison with a Gauss-Markov bias."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize
from scipy.special import ndtr, ndtri

from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.filter_noise.stretch import NAMES, WEIGHTS, Stretch
from trihedron.estimate.importance import LEAST_DRAWS, drawn_from
from trihedron.estimate.reference.beside import BLOCK_S
from trihedron.estimate.reference.likelihood import FARTHEST
from trihedron.probability import NORMAL_95
from trihedron.records.filter_noise import Bounded

COORDINATES = ("noise", "vibration", "bias_walk", "white", "slow", "slow_s", "body", "per_kelvin")
"""Coordinates of the search: logarithms of strengths; ``slow`` is the reference's total slow error; ``body`` is a
standard normal number whose quantile Φ(x), in right angles, is the angle with world part ``slow`` cos, body part
``slow`` sin. Two strengths that may both be zero would have a posterior with a corner. The ratio of the parts is then
half-Cauchy; Φ(x) as the share of the *square* makes a zero body part so unlikely that ``slow`` comes out too small."""
SLOW_S = COORDINATES.index("slow_s")
MAY_BE_NOTHING = np.isin(COORDINATES, ("vibration", "bias_walk", "white", "slow", "per_kelvin"))
STEP = 1e-3
"""Step in a coordinate for derivatives of the covariance."""
SEARCHES, LONGEST_STEP, ENOUGH = 80, 2.0, 0.01
"""Most steps of the search, longest step in a coordinate, and gain of the log posterior below which it ends."""
DRAWN, ENOUGH_DRAWS = 400, 40
"""Number of draws returned; effective ones per strength above which sampling may end: of 280 draws the ends of a 95 %
interval are sound, of 100 they are too close together."""
TIMES_S = (10.0, 30.0, 100.0)
"""Correlation times of a Gauss-Markov bias that are compared with the random walk."""
PREFERRED = 6.0
"""Gain in 2 ln evidence that a Gauss-Markov bias needs: 2 ln 3 for three time constants, and 4."""
WIDER_BY, LEAST_SIGMA = 2.0, 0.2
"""Prior σ from another sensor's draws, in their σ, and its minimum (finite number of draws): both sensors observe one
realisation of the reference's error, whose information about the strength counts once."""
ABSENT = 30.0
"""Ratio of the ends of a 95 % interval above which only the upper limit is stated."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior of the coordinates: ``mean`` (8,), ``sigma`` (8,); ``is_there`` (8,) is 1 for those in the model.

    A strength that ``may_be_nothing`` (8,) has a half-Cauchy prior with median exp(mean) (Gelman 2006): flat towards
    zero, so that the log and not the prior sets the upper limit of a strength that is not detected, and of a tail that
    does not pull down a large one: with three degrees of freedom in place of one, predicted covariances are 5 % too
    small (NEES of attitude 3.3 at 10 s). ``sigma`` then bounds the search. The other coordinates are normal.
    """

    mean: FloatArray
    sigma: FloatArray
    is_there: FloatArray
    may_be_nothing: BoolArray = field(default_factory=MAY_BE_NOTHING.copy)

    def ends(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest coordinates (8,). A slow error that lasts less than a block is white between blocks."""
        lowest = self.mean - FARTHEST * self.sigma
        lowest[SLOW_S] = max(lowest[SLOW_S], np.log(BLOCK_S))
        return lowest, self.mean + FARTHEST * self.sigma


@dataclass(frozen=True, eq=False)
class Fitted:
    """Strengths (8,) in SI at the posterior maximum, log evidence of the model, posterior draws (k, 8) of the
    strengths, and their effective number; ``follows``: the reference repeats this sensor's noise."""

    mode: FloatArray
    evidence: float
    draws: FloatArray
    n_effective: float
    follows: bool = False

    @property
    def is_settled(self) -> bool:
        """Whether the effective number of draws exceeds ``LEAST_DRAWS`` per free strength."""
        return bool(self.n_effective > LEAST_DRAWS * np.count_nonzero(np.ptp(self.draws, axis=0)))


def most_likely(stretches: Sequence[Stretch], prior: Prior) -> tuple[FloatArray, FloatArray]:
    """Free coordinates (f,) at the posterior maximum, and the information (f, f) there.

    Levenberg-Marquardt steps with the average information: along the posterior's ridges a gradient search stops early.
    """
    free = prior.is_there > 0.0
    lowest, highest = (end[free] for end in prior.ends())
    x = prior.mean[free]
    here = height(stretches, prior, x)
    slope, information = _slope(stretches, prior, x)
    damping = 0.1
    for _ in range(SEARCHES):
        step = np.linalg.solve(information + damping * np.diag(np.diag(information)), slope)
        step *= min(1.0, LONGEST_STEP / float(np.max(np.abs(step))))
        tried = np.clip(x + step, lowest + STEP, highest - STEP)
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
    """Gradient (f,) of the log posterior, and its average information (f, f; Gilmour et al. 1995)."""
    free = prior.is_there > 0.0
    far, sigma = x - prior.mean[free], prior.sigma[free]
    # Of the log half-Cauchy density by the logarithm of the strength; the second derivative averaged over the prior.
    half_cauchy = 1.0 - 2.0 / (1.0 + np.exp(-2.0 * far))
    slope = np.where(prior.may_be_nothing[free], half_cauchy, -far / sigma**2)
    information = np.diag(np.where(prior.may_be_nothing[free], 0.5, 1.0 / sigma**2))
    at = whole(prior, x)
    others = [whole(prior, x + STEP * e) for e in np.eye(len(x))]
    for one in stretches:
        V = one.covariance(at)
        inverse = cho_solve(cho_factor(V + one.columns @ one.columns.T, lower=True), np.eye(len(V)))
        weighed = inverse @ one.observed
        carried = []
        for k, other in enumerate(others):
            change = (one.covariance(other) - V) / STEP
            carried.append(change @ weighed)
            slope[k] += 0.5 * (weighed @ carried[k] - np.sum(inverse * change))
        information += 0.5 * np.array(carried) @ inverse @ np.array(carried).T
    return slope, information


def height(stretches: Sequence[Stretch], prior: Prior, x: FloatArray) -> float:
    """Log posterior (evidence times prior) at free coordinates (f,); -inf outside ``Prior.ends``."""
    free = prior.is_there > 0.0
    far, sigma = x - prior.mean[free], prior.sigma[free]
    lowest, highest = (end[free] for end in prior.ends())
    if np.any(x < lowest) or np.any(x > highest):
        return -np.inf
    strengths = whole(prior, x)
    normal = -0.5 * (far / sigma) ** 2 - np.log(np.sqrt(2.0 * np.pi) * sigma)
    half = np.log(2.0 / np.pi) + far - np.log1p(np.exp(2.0 * far))
    known = np.sum(np.where(prior.may_be_nothing[free], half, normal))
    return float(sum(one.evidence(strengths) for one in stretches) + known)


def whole(prior: Prior, x: FloatArray) -> FloatArray:
    """Strengths (8,) in SI from free coordinates (f,); strengths that are not in the model are 0."""
    every = np.full(len(COORDINATES), -np.inf)
    every[prior.is_there > 0.0] = x
    angle = 0.5 * np.pi * float(ndtr(every[6]))
    slow = np.exp(every[4])
    return np.array([*np.exp(every[:4]), slow * np.cos(angle), slow * np.sin(angle), *np.exp(every[[5, 7]])])


def with_slow_error_of(prior: Prior, draws: FloatArray) -> Prior:
    """``prior`` of another sensor with the reference's slow error from ``draws`` (k, 8) of this sensor: it is one
    attitude error, in the angle of the gyro and in the tilt of gravity for the accelerometer."""
    s = dict(zip(NAMES, draws.T, strict=True))
    right_angles = np.arctan2(s["body"], s["world"]) / (0.5 * np.pi)
    told = {
        "slow": np.log(np.hypot(s["world"], s["body"])),
        "slow_s": np.log(s["slow_s"]),
        # Clipped at 5 σ: rounding makes some parts exactly zero.
        "body": np.clip(ndtri(right_angles), -5.0, 5.0),
    }
    mean, sigma, may_be_nothing = prior.mean.copy(), prior.sigma.copy(), prior.may_be_nothing.copy()
    for name, values in told.items():
        at = COORDINATES.index(name)
        mean[at], sigma[at], may_be_nothing[at] = values.mean(), max(WIDER_BY * float(values.std()), LEAST_SIGMA), False
    return replace(prior, mean=mean, sigma=sigma, may_be_nothing=may_be_nothing)


def fit(stretches: Sequence[Stretch], prior: Prior) -> Fitted:
    """Posterior of the strengths by adaptive importance sampling.

    Proposals are in coordinates u whose strength is proportional to sinh u where it may be nothing: its density is flat
    at 0, where the logarithm has a long tail that proposals of the right moments miss.
    """
    mode, information = most_likely(stretches, prior)
    from_zero = prior.may_be_nothing[prior.is_there > 0.0]
    # u is 1 at the mode; there du / d log s is tanh 1.
    slope = np.where(from_zero, np.tanh(1.0), 1.0)
    first = np.linalg.inv(information) * np.outer(slope, slope)

    def coordinates(u: FloatArray) -> FloatArray:
        return np.where(from_zero, mode + np.log(np.sinh(np.where(from_zero, u, 1.0)) / np.sinh(1.0)), u)

    def log_density(u: FloatArray) -> float:
        if np.any(u[from_zero] <= 0.0):
            return -np.inf
        return height(stretches, prior, coordinates(u)) - float(np.sum(np.log(np.tanh(u[from_zero]))))

    drawn = drawn_from(log_density, np.where(from_zero, 1.0, mode), first, ENOUGH_DRAWS * len(mode))
    draws = np.array([whole(prior, coordinates(one)) for one in drawn.chosen(DRAWN)])
    best = whole(prior, coordinates(drawn.points[np.argmax(drawn.heights)]))
    return Fitted(best, drawn.evidence, draws, drawn.n_effective)


def bounded(values: Sequence[float] | FloatArray) -> Bounded:
    """Median and 95 % interval of draws; an upper limit where the interval spans more than a factor of ``ABSENT``."""
    # The truth is one draw more: ends between order statistics k and n + 1 - k hold it with 1 - 2 k/(n + 1).
    low, middle, high = (float(v) for v in np.quantile(values, [0.025, 0.5, 0.975], method="weibull"))
    is_limit = high > 0.0 and low < high / ABSENT
    return Bounded(middle, 0.0 if is_limit else low, high, is_limit)


def forgetting(stretches: Sequence[Stretch], walk: Fitted) -> tuple[float, float, float]:
    """Gain in 2 ln evidence, σ [SI] and correlation time [s] of the best Gauss-Markov bias over the random walk, with
    the other strengths fixed."""
    at, found = NAMES.index("bias_walk"), []
    for tau in TIMES_S:
        one = [replace(stretch, forgets_s=tau) for stretch in stretches]
        for size in walk.mode[at] * np.sqrt(0.5 * tau) * np.geomspace(1.0 / 30.0, 30.0, 13):
            strengths = walk.mode.copy()
            strengths[at] = size
            found.append((float(sum(stretch.evidence(strengths) for stretch in one)), float(size), tau))
    best, sigma, tau = max(found)
    return 2.0 * (best - sum(stretch.evidence(walk.mode) for stretch in stretches)), sigma, tau


# White noise of X, Y and Z separately, in motion: rotation distributes them differently over the world axes.


AXES_STEP = 0.05
"""Step in the logarithm of an axis' density, for the curvature."""
AXES_SIGMA = float(np.log(3.0))
"""Prior σ of that logarithm about the axes' mean: axes of one chip differ by less than a factor of three."""


def unlike_axes_beside(stretches: Sequence[Stretch], found: Fitted, N: Bounded) -> tuple[Bounded, ...]:
    """N of each axis, static noise and vibration together, where the evidence prefers three densities to one; else ().

    The other strengths are fixed; every axis' interval includes that of the common N.
    """
    if N.is_limit:
        return ()
    others = np.where(np.isin(NAMES, ("noise", "vibration")), 0.0, found.mode)
    pairs = [(one.covariance(others), _of_axes(one, found.mode)) for one in stretches]

    def low(x: FloatArray) -> float:
        heights = [
            one.evidence_under(rest + np.tensordot(np.exp(2.0 * x), axes, axes=1))
            for one, (rest, axes) in zip(stretches, pairs, strict=True)
        ]
        return float(0.5 * x @ x / AXES_SIGMA**2 - sum(heights))

    best = np.asarray(minimize(low, np.zeros(3), method="L-BFGS-B", options={"eps": 1e-4, "ftol": 1e-7}).x)
    steps = AXES_STEP * np.eye(3)
    here = low(best)
    curved = np.array([(low(best + e) + low(best - e) - 2.0 * here) / AXES_STEP**2 for e in steps])
    own = 1.0 / np.maximum(curved, 1.0 / AXES_SIGMA**2)
    if 2.0 * (low(np.zeros(3)) - here) + float(np.sum(np.log(own / AXES_SIGMA**2))) < PREFERRED:
        return ()
    common = (0.25 * np.log(N.upper / max(N.lower, N.upper / ABSENT))) ** 2
    values, factors = N.value * np.exp(best), np.exp(NORMAL_95 * np.sqrt(own + common))
    ends = zip(values.tolist(), (values / factors).tolist(), (values * factors).tolist(), strict=True)
    return tuple(Bounded(*one) for one in ends)


def _of_axes(stretch: Stretch, strengths: FloatArray) -> FloatArray:
    """(3, 3 m, 3 m) covariance of noise and vibration of each body axis, in the reference's world frame."""
    m, n = len(stretch.time_s), len(stretch.power)
    density = stretch.step_s * (strengths[0] ** 2 + strengths[1] ** 2 * stretch.power)
    size = np.sqrt(np.outer(density, WEIGHTS)).ravel()
    # The attitude in a block; of velocities, at its end.
    attitude = np.repeat(stretch.attitude[np.minimum(np.arange(n), m - 1)], len(WEIGHTS), axis=0)
    out = []
    for axis in range(3):
        root = np.einsum("mp,p,pa->map", stretch.walk, size, attitude[:, :, axis]).reshape(3 * m, -1)
        out.append(root @ root.T)
    return np.array(out)
