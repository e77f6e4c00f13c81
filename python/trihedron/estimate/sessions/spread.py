"""Standard deviations between sessions with intervals that are valid for few sessions (docs/many-recordings.md).

The model of one parameter: ``y_ij = μ + d_i + u_ij + e_ij``, ``d`` of the group (day, device) with variance σ_d²,
``u`` of the session with σ_u², ``e`` the session's own error with known variance. Point and interval
invert the weighted sum of squares

    Q(σ²) = Σ w_ij (y_ij - ȳ_i)²,   w = 1/(σ² + v_ij),   Q(σ_u²) ~ χ²_ν                                        (1)

which is exact for any number of sessions (Hartung and Knapp 2005; Viechtbauer 2007). Between groups the variance of a
group's mean depends on the unknown σ_u: (1) is averaged over the distribution of σ_u by (1) (a generalised interval).
"""

from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np

from trihedron.arrays import TINY, FloatArray, IntArray
from trihedron.errors import InputError
from trihedron.probability import chdtri, ndtri, stdtrit
from trihedron.records.sessions import PARAMETERS, Repeated, Session, Spread


def repeated_parameters(sessions: Sequence[Session]) -> tuple[Repeated, ...]:
    """Mean and spreads of each parameter over all sessions, which are grouped by their ``group``.

    Where every session is its own group there is one spread, between sessions, in ``within``. Raises ``InputError``
    with fewer than two sessions.
    """
    if len(sessions) < 2:
        raise InputError("one recording does not show how far a parameter repeats; give two or more.")
    groups = _groups(sessions)
    out = []
    for k, parameter in enumerate(PARAMETERS[: len(sessions[0].numbers)]):
        values = np.array([session.numbers[k] for session in sessions])
        own = np.array([max(float(session.covariance[k, k]), TINY) for session in sessions])
        within = spread_within(values, own, groups)
        between = spread_between(values, own, groups)
        mean = common_mean(values, own, groups, within, between)
        own_std = float(np.sqrt(np.median(own)))
        out.append(Repeated(parameter, *mean, within, between, own_std))
    return tuple(out)


def next_session(sessions: Sequence[Session], repeated: Sequence[Repeated]) -> tuple[FloatArray, FloatArray]:
    """(k,) standard deviations of the next session's parameters from the common ones, and of the errors of these.

    The axes of an id are assumed to have one repeatability, which is estimated from all of them.
    """
    groups = _groups(sessions)
    numbers = np.array([session.numbers for session in sessions])
    own = np.array([np.maximum(np.diag(session.covariance), TINY) for session in sessions])
    within2, between2 = np.zeros(len(repeated)), np.zeros(len(repeated))
    for name in dict.fromkeys(one.parameter.id for one in repeated):
        of = [k for k, one in enumerate(repeated) if one.parameter.id == name]
        by_axis = [(axis, group) for axis in of for group in groups]
        within2[of] = spread_of_next(spread_within(numbers[:, of].T.ravel(), own[:, of].T.ravel(), by_axis)) ** 2
        between2[of] = np.mean([spread_of_next(repeated[k].between) ** 2 for k in of])
    error2 = np.maximum([one.std**2 for one in repeated], within2 / len(sessions) + between2 / len(set(groups)))
    return np.sqrt(within2 + between2), np.sqrt(error2)


def _groups(sessions: Sequence[Session]) -> list[str]:
    groups = [session.group for session in sessions]
    return [""] * len(groups) if len(set(groups)) == len(groups) else groups


LEVEL = 0.95
QUANTILES = 60
"""Points of the distribution of σ_u over which an interval of σ_d is averaged: twice as many change its ends by less
than 1 %."""
BISECTIONS = 60
"""Bisections of the interval of ln σ²: the result is exact to rounding."""


def spread_within(values: FloatArray, variances: FloatArray, groups: Sequence[object]) -> Spread | None:
    """σ_u of sessions (n,) about the mean of their group; ``None`` where no group has two sessions.

    ``variances`` (n,) are those of the sessions' own errors.
    """
    order, starts = _grouped(groups)
    dof = len(order) - len(starts)
    return _spread(values[order], variances[order], starts, dof) if dof > 0 else None


def spread_between(values: FloatArray, variances: FloatArray, groups: Sequence[object]) -> Spread | None:
    """σ_d of groups about their mean; ``None`` for a single group or where no group has two sessions.

    With one session per group, σ_d and σ_u are not separable: :func:`spread_within` with all sessions in one group
    estimates both together.
    """
    within = spread_within(values, variances, groups)
    order, starts = _grouped(groups)
    dof = len(starts) - 1
    if within is None or dof < 1:
        return None
    y, v = values[order], variances[order]
    points = (np.arange(QUANTILES) + 0.5) / QUANTILES
    inner = _solved(y, v, starts, _chi_square(points, within.dof))
    draws = _solved(*_group_means(y, v, starts, inner[:, None]), ONE_GROUP, _chi_square(points, dof))
    ends = np.sqrt(np.quantile(draws, [0.5 - LEVEL / 2.0, 0.5 + LEVEL / 2.0]))
    means = _spread(*_group_means(y, v, starts, within.sd**2), ONE_GROUP, dof)
    high = float(ends[1]) or means.high
    return Spread(float(np.clip(means.sd, ends[0], high)), float(ends[0]), high, dof)


def spread_of_next(spread: Spread | None) -> float:
    """Standard deviation of which ±1.96 about the mean contain another session with 95 %.

    The most likely spread of few sessions is often zero but uncertain: the variance has a scaled inverse χ²
    distribution through the upper end of its interval, and a value drawn with it is Student's t. This is exact where
    the sessions' own errors are zero.
    """
    if spread is None:
        return 0.0
    tail = 0.5 - LEVEL / 2.0
    variance = spread.high**2 * _exceeded(1.0 - tail, spread.dof) / spread.dof
    return float(np.sqrt(variance) * stdtrit(spread.dof, tail) / ndtri(tail))


def common_mean(
    values: FloatArray, variances: FloatArray, groups: Sequence[object], within: Spread | None, between: Spread | None
) -> tuple[float, float, float]:
    """μ, its standard uncertainty, and half the width of its interval at :data:`LEVEL`, which accounts for the number
    of groups (Hartung and Knapp 2001).

    The weighted mean of group means; its variance is that of their scatter about it, at least the stated one.
    """
    if within is None:
        value = float(np.average(values, weights=1.0 / variances))
        std = float(np.sqrt(1.0 / np.sum(1.0 / variances)))
        return value, std, -stdtrit(max(len(values), 2), 0.5 - LEVEL / 2.0) * std
    if between is None:
        level, variance = values, variances + within.sd**2
    else:
        order, starts = _grouped(groups)
        level, variance = _group_means(values[order], variances[order], starts, within.sd**2)
        variance = variance + between.sd**2
    weights = 1.0 / variance
    value = float(np.average(level, weights=weights))
    dof = len(level) - 1
    scatter = float(np.sum(weights * (level - value) ** 2)) / dof
    std = float(np.sqrt(max(scatter, 1.0) / np.sum(weights)))
    return value, std, -stdtrit(dof, 0.5 - LEVEL / 2.0) * std


def _chi_square(above: Iterable[float], dof: int) -> FloatArray:
    """(k,) values that a chi-square variate exceeds with these probabilities."""
    return np.array([_exceeded(float(p), dof) for p in above])


@cache
def _exceeded(above: float, dof: int) -> float:
    # Cached: the same hundred values serve all 21 parameters.
    return chdtri(dof, above)


ONE_GROUP = np.zeros(1, dtype=np.int64)
"""Where the only group begins."""


def _grouped(groups: Sequence[object]) -> tuple[IntArray, IntArray]:
    """Order (n,) that brings the sessions of a group together, and where in it the groups (g,) begin."""
    names = {group: number for number, group in enumerate(dict.fromkeys(groups))}
    number = np.array([names[group] for group in groups])
    return np.argsort(number, kind="stable"), np.append(0, np.cumsum(np.bincount(number))[:-1])


def _spread(y: FloatArray, v: FloatArray, starts: IntArray, dof: int) -> Spread:
    """Spread of values and variances (n,) by group: σ at which Q is its mean (Paule and Mandel 1982), its interval."""
    tail = 0.5 - LEVEL / 2.0
    targets = np.append(_chi_square([tail, 1.0 - tail], dof), dof)
    low, high, point = np.sqrt(_solved(y, v, starts, targets))
    if high == 0.0:
        # Sessions agree better than their uncertainties allow: these are reduced for the upper limit, which is not 0.
        q = float(_q(y, v, starts, np.zeros(1))[0])
        high = float(np.sqrt(_solved(y, v * max(q / dof, 1e-6), starts, targets[1:2])[0]))
    return Spread(float(point), float(low), float(high), dof)


def _q(y: FloatArray, v: FloatArray, starts: IntArray, s2: FloatArray) -> FloatArray:
    """Q (..., m) of equation (1) at every σ² (..., m), of values and variances (..., n) in groups."""
    y, v = y[..., None, :], v[..., None, :] + s2[..., None]
    mean, _ = _group_means(y, v, starts)
    away = y - np.repeat(mean, np.diff(starts, append=y.shape[-1]), axis=-1)
    return np.asarray((away**2 / v).sum(axis=-1))


def _solved(y: FloatArray, v: FloatArray, starts: IntArray, targets: FloatArray) -> FloatArray:
    """σ² (..., m) at which Q, which decreases with σ², equals each target (m,); 0 where Q(0) is below it."""
    squares = _q(y, np.zeros_like(v), starts, np.ones(1))
    scale = max(float(squares.max()), float(v.max()), TINY)
    shape = (*y.shape[:-1], len(targets))
    low, high = np.full(shape, np.log(1e-12 * scale)), np.full(shape, np.log(1e6 * scale))
    is_zero = _q(y, v, starts, np.exp(low)) <= targets
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        above = _q(y, v, starts, np.exp(middle)) > targets
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return np.where(is_zero, 0.0, np.exp(0.5 * (low + high)))


def _group_means(
    y: FloatArray, v: FloatArray, starts: IntArray, s2: FloatArray | float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Weighted mean (..., g) of every group and its variance, at a given σ_u²."""
    weights = 1.0 / (v + s2)
    total = np.add.reduceat(weights, starts, axis=-1)
    return np.asarray(np.add.reduceat(weights * y, starts, axis=-1) / total), 1.0 / total
