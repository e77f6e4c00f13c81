"""Attitude of gyros against their references over whole recordings: parameters and noise strengths by one evidence.

The parameters enter linearly (``trihedron._core.ReferenceBlocks``); each has a Gaussian prior, and in units of its
prior σ the evidence of a hypothesis is that of a ridge regression under the covariance of the noise strengths. The
strengths are unknown in every hypothesis and integrated out (docs/reference.md). Several recordings share some
parameters; strengths are per recording.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import minimize

from trihedron._core import ReferenceBlocks, ReferenceNormal
from trihedron.arrays import FloatArray, IntArray
from trihedron.estimate.importance import drawn_from
from trihedron.threads import side_by_side

Height = Callable[[FloatArray], float]

STRENGTHS = ("angle_walk", "scale_noise", "bias_walk", "white", "world", "world_s", "body", "body_s")
TYPICAL = np.log([2e-4, 1e-4, 2e-5, 3e-4, 1e-3, 8.0, 1e-3, 8.0])
"""Prior means of the logarithms: consumer gyros and optical trackers; rad/√s, √s, rad/s/√s, rad, rad, s, rad, s."""
SPREAD = np.log([30.0, 30.0, 30.0, 30.0, 30.0, 4.0, 30.0, 4.0])
"""Prior σ of the logarithms: a factor of 30 either way, of 4 for time constants."""
FARTHEST = 4.0
"""Limit of the search in prior σ: beyond it a strength is negligible."""
LEAST_SPREAD = 0.01
"""Smallest posterior σ of a strength that is used, relative to the prior's."""
KINDS = tuple(k for k, name in enumerate(STRENGTHS) if not name.endswith("_s"))
"""Indices of the sizes among the strengths: each is one kind of error."""
TRIED_SIZES = np.linspace(-1.0, 2.0, 7)
"""Sizes of one error at which the search may begin, in prior σ from typical."""
STARTS = 3
"""Starts of the search: one error explains the residual nearly as well as another, and each is a maximum of its own."""
STEP = 1e-4
CURVATURE_STEP = 0.25
"""Steps in the logarithm of a strength for the gradient (the curvature reaches the number of rows: a hundred times as
long a step ended searches ten units of log evidence too early), and for the curvature with which sampling begins."""
MOST_TURNS, FIRST_TURNS = 60, 15
"""Turns of a search; turns after which only the best of several searches goes on."""
DRAWN, ENOUGH_DRAWS = 40, 10
"""Draws of the strengths that parameters are averaged over; effective ones per strength that end the sampling."""


@dataclass(frozen=True, eq=False)
class Problem:
    """One recording: its blocks, observations (3 m,), and columns (3 m, p) of parameters in units of ``sigma`` (p,).

    ``centre`` (p,) is each prior mean relative to the point of linearisation, in the same units; ``index`` (p,) the
    indices among all parameters of the fit; ``bias`` the indices here of the bias at the start.
    """

    blocks: ReferenceBlocks
    observed: FloatArray
    columns: FloatArray
    sigma: FloatArray
    centre: FloatArray
    index: IntArray
    bias: slice

    @cached_property
    def table(self) -> FloatArray:
        """Columns and observations (3 m, p + 1), the filter's input."""
        return np.ascontiguousarray(np.column_stack([self.columns, self.observed]))


Equations = tuple[ReferenceNormal, float]
"""Normal equations under strengths, observations last, and the constant of the log evidence."""


def equations(problem: Problem, strengths: FloatArray) -> Equations:
    """Normal equations of a recording under ``strengths`` (8,), logarithms in the order of :data:`STRENGTHS`."""
    found = problem.blocks.normal(problem.table, np.exp(strengths).tolist())
    far = (strengths - TYPICAL) / SPREAD
    square = found.gram[-1, -1] + found.log_det + 3 * found.rows * np.log(2.0 * np.pi) + float(far @ far)
    return found, -0.5 * float(square)


@dataclass(frozen=True, eq=False)
class Together:
    """Posterior of all parameters under given strengths: mean (p,), covariance (p, p), log evidence.

    With every bias as its mean over time instead of its value at the start parameters are ``change`` (p, p) times these
    plus ``shift`` (p,), with the covariance ``added`` (p, p) of the walks.
    """

    mean: FloatArray
    covariance: FloatArray
    evidence: float
    change: FloatArray
    shift: FloatArray
    added: FloatArray


def together(problems: Sequence[Problem], strengths: FloatArray) -> Together:
    """Posterior of several recordings in one fit under ``strengths`` (recordings, 8); every prior counts once."""
    found = [equations(p, s) for p, s in zip(problems, strengths, strict=True)]
    L, half, evidence = _eliminated(problems, found)
    inverse = np.linalg.inv(L)
    change, shift, added = np.eye(len(L)), np.zeros(len(L)), np.zeros(L.shape)
    for problem, (one, _) in zip(problems, found, strict=True):
        b, sigma = problem.index[problem.bias], problem.sigma[problem.bias]
        change[np.ix_(b, problem.index)] -= one.mean_bias[:, :-1] / sigma[:, None]
        shift[b] = one.mean_bias[:, -1] / sigma
        added[np.ix_(b, b)] = one.cov_mean_bias / np.outer(sigma, sigma)
    return Together(inverse.T @ half, inverse.T @ inverse, evidence, change, shift, added)


def _eliminated(problems: Sequence[Problem], found: Sequence[Equations]) -> tuple[FloatArray, FloatArray, float]:
    """Cholesky root L of the information, L⁻¹ times the moment, and the log evidence."""
    n = 1 + max(int(p.index.max()) for p in problems)
    information, moment, centre, constant = np.eye(n), np.zeros(n), np.zeros(n), 0.0
    for problem, (one, own) in zip(problems, found, strict=True):
        information[np.ix_(problem.index, problem.index)] += one.gram[:-1, :-1]
        moment[problem.index] += one.gram[:-1, -1]
        centre[problem.index] = problem.centre
        constant += own
    moment += centre
    L = np.linalg.cholesky(information)
    half = np.linalg.solve(L, moment)
    evidence = constant - 0.5 * float(centre @ centre) + 0.5 * float(half @ half) - float(np.sum(np.log(np.diag(L))))
    return np.asarray(L), half, evidence


@dataclass(frozen=True, eq=False)
class Fitted:
    """Parameters of one hypothesis with the strengths integrated out: mean (p,) and covariance (p, p) in prior units.

    Biases are means over time. ``strengths`` (recordings, 8) are the logarithms at the posterior maximum, ``evidence``
    the log evidence there; ``draws`` (k, recordings, 8) their posterior.
    """

    mean: FloatArray
    covariance: FloatArray
    evidence: float
    strengths: FloatArray
    draws: FloatArray

    def spread(self) -> FloatArray:
        """Cholesky roots (recordings, 8, 8) of the covariance of the strengths' logarithms."""
        # With few different draws their covariance is singular.
        least = np.diag((LEAST_SPREAD * SPREAD) ** 2)
        return np.array([np.linalg.cholesky(np.cov(one.T) + least) for one in self.draws.swapaxes(0, 1)])


def most_likely(
    problems: Sequence[Problem], start: FloatArray, spread: FloatArray | None = None, *, is_everywhere: bool = False
) -> tuple[FloatArray, float]:
    """Logarithms (recordings, 8) of the strengths at the posterior maximum, and the log evidence there.

    ``spread`` (recordings, 8, 8) are roots of their covariance under a neighbouring hypothesis at ``start``: in these
    units the problem is well conditioned, and a few steps are enough. Sought ``is_everywhere`` or near ``start``.
    """
    best = start.copy()
    roots = np.tile(np.eye(len(TYPICAL)), (len(problems), 1, 1)) if spread is None else spread
    # From the strengths of a neighbouring hypothesis one round over the recordings is enough.
    for _ in range(1 if len(problems) == 1 or spread is not None else 2):
        for k, root in enumerate(roots):
            height = _heights(problems, best, k)
            if is_everywhere:
                tried = [_highest(height, one, root, FIRST_TURNS) for one in (best[k], *_starts(height))]
                best[k] = max(tried, key=height)
            best[k] = _highest(height, best[k], root)
    return best, height(best[-1])


def _starts(height: Height) -> list[FloatArray]:
    """Likeliest points at which one kind of error has its own most likely size and the others are typical."""
    points = TYPICAL + np.einsum("k,ij->ikj", TRIED_SIZES, np.diag(SPREAD)[list(KINDS)])
    heights = np.reshape(side_by_side(height, points.reshape(-1, len(TYPICAL))), points.shape[:2])
    best = heights.argmax(axis=1)
    return [points[i, best[i]] for i in np.argsort(-heights.max(axis=1))[:STARTS]]


def _highest(height: Height, start: FloatArray, root: FloatArray, turns: int = MOST_TURNS) -> FloatArray:
    """Maximum (8,) of ``height`` by L-BFGS from ``start``, in units of ``root`` (8, 8)."""

    def at(z: FloatArray) -> FloatArray:
        return np.clip(start + root @ z, TYPICAL - FARTHEST * SPREAD, TYPICAL + FARTHEST * SPREAD)

    def descent(z: FloatArray) -> tuple[float, FloatArray]:
        here, *ahead = side_by_side(lambda one: height(at(one)), [z, *(z + STEP * np.eye(len(z)))])
        return -here, np.array([(here - one) / STEP for one in ahead])

    begin = np.zeros(len(start))
    found = minimize(descent, begin, jac=True, method="L-BFGS-B", options={"ftol": 3e-6, "maxiter": turns})
    return at(found.x)


def _heights(problems: Sequence[Problem], strengths: FloatArray, k: int) -> Height:
    """Log evidence as a function of the strengths of recording k, with those of the others fixed."""
    found = [equations(p, s) if j != k else None for j, (p, s) in enumerate(zip(problems, strengths, strict=True))]

    def height(x: FloatArray) -> float:
        own = equations(problems[k], x)
        return _eliminated(problems, [own if one is None else one for one in found])[2]

    return height


def fit(problems: Sequence[Problem], start: FloatArray) -> Fitted:
    """Mode of the strengths, draws of their posterior per recording, and parameters averaged over these."""
    best, evidence = most_likely(problems, start)
    draws = np.stack([_drawn(_heights(problems, best, k), best[k]) for k in range(len(problems))], axis=1)
    solved = [together(problems, draw) for draw in draws]
    means = np.array([one.change @ one.mean + one.shift for one in solved])
    each = [one.change @ one.covariance @ one.change.T + one.added for one in solved]
    covariance = np.mean(each, axis=0) + np.cov(means.T, bias=True)
    return Fitted(means.mean(axis=0), covariance, evidence, best, draws)


def _drawn(height: Height, best: FloatArray) -> FloatArray:
    """(k, 8) draws of the strengths of one recording, whose posterior has its maximum at ``best`` (8,)."""

    def inside(x: FloatArray) -> float:
        return -np.inf if np.any(np.abs(x - TYPICAL) > FARTHEST * SPREAD) else height(x)

    beside = best + CURVATURE_STEP * np.concatenate([np.eye(len(best)), -np.eye(len(best))])
    curved = 2.0 * height(best) - np.sum(np.reshape(side_by_side(height, beside), (2, -1)), axis=0)
    variance = 1.0 / np.maximum(curved / CURVATURE_STEP**2, 1.0 / SPREAD**2)
    return drawn_from(inside, best, np.diag(variance), ENOUGH_DRAWS * len(best)).chosen(DRAWN)
