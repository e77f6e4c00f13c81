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

from trihedron.arrays import TINY, BoolArray, FloatArray, IntArray
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
    members = _members(groups)
    dof = sum(len(group) - 1 for group in members)
    if dof < 1:
        return None
    return _spread(*_padded(values, variances, members), dof)


def spread_between(values: FloatArray, variances: FloatArray, groups: Sequence[object]) -> Spread | None:
    """σ_d of groups about their mean; ``None`` for a single group or where no group has two sessions.

    With one session per group, σ_d and σ_u are not separable: :func:`spread_within` with all sessions in one group
    estimates both together.
    """
    members = _members(groups)
    dof_within = sum(len(group) - 1 for group in members)
    if len(members) < 2 or dof_within < 1:
        return None
    within = _spread(*_padded(values, variances, members), dof_within)
    dof = len(members) - 1
    one_group = [np.arange(len(members))]
    points = (np.arange(QUANTILES) + 0.5) / QUANTILES
    inner = _solved(*_padded(values, variances, members), _chi_square(points, dof_within))
    targets = _chi_square(points, dof)
    at_each = [_group_means(values, variances, members, s2) for s2 in inner]
    level, own = (np.array(one)[:, None, :] for one in zip(*at_each, strict=True))
    draws = _solved(level, own, np.ones((1, len(members)), dtype=bool), targets)
    ends = np.sqrt(np.quantile(draws, [0.5 - LEVEL / 2.0, 0.5 + LEVEL / 2.0]))
    means = _padded(*_group_means(values, variances, members, within.sd**2), one_group)
    point = float(np.sqrt(_solved(*means, np.array([float(dof)]))[0]))
    if ends[1] == 0.0:
        ends[1] = _spread(*means, dof).high
    return Spread(float(np.clip(point, *ends)), float(ends[0]), float(ends[1]), dof)


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
    members = _members(groups)
    if between is None:
        level, variance = values, variances + within.sd**2
    else:
        level, variance = _group_means(values, variances, members, within.sd**2)
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


def _members(groups: Sequence[object]) -> list[IntArray]:
    names = list(dict.fromkeys(groups))
    return [np.array([k for k, group in enumerate(groups) if group == name], dtype=np.int64) for name in names]


def _spread(y: FloatArray, v: FloatArray, is_there: BoolArray, dof: int) -> Spread:
    """Spread of values and variances by group: σ at which Q is its mean (Paule and Mandel 1982), and its interval."""
    tail = 0.5 - LEVEL / 2.0
    targets = np.append(_chi_square([tail, 1.0 - tail], dof), dof)
    low, high, point = np.sqrt(_solved(y, v, is_there, targets))
    if high == 0.0:
        # Sessions agree better than their uncertainties allow: these are reduced for the upper limit, which is not 0.
        q = float(_q(y, v, is_there, np.zeros(1))[0])
        high = float(np.sqrt(_solved(y, v * max(q / dof, 1e-6), is_there, targets[1:2])[0]))
    return Spread(float(point), float(low), float(high), dof)


def _q(y: FloatArray, v: FloatArray, is_there: BoolArray, s2: FloatArray) -> FloatArray:
    """Q (..., m) of equation (1) at every σ² (..., m), of values and variances (..., g, most) by group."""
    weights = np.where(is_there, 1.0 / (v[..., None, :, :] + s2[..., None, None]), 0.0)
    mean = (weights * y[..., None, :, :]).sum(axis=-1) / weights.sum(axis=-1)
    return np.asarray((weights * (y[..., None, :, :] - mean[..., None]) ** 2).sum(axis=(-1, -2)))


def _padded(
    values: FloatArray, variances: FloatArray, members: list[IntArray]
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Values, variances and their mask, one group a row (g, most): the sums over all groups are vectorised."""
    size = np.array([len(group) for group in members])
    is_there = np.arange(size.max()) < size[:, None]
    y, v = np.zeros(is_there.shape), np.ones(is_there.shape)
    together = np.concatenate(members)
    y[is_there], v[is_there] = values[together], variances[together]
    return y, v, is_there


def _solved(y: FloatArray, v: FloatArray, is_there: BoolArray, targets: FloatArray) -> FloatArray:
    """σ² (..., m) at which Q, which decreases with σ², equals each target (m,); 0 where Q(0) is below it."""
    centre = np.sum(y, axis=-1, where=is_there) / is_there.sum(axis=-1)
    squares = np.sum((y - centre[..., None]) ** 2, axis=(-1, -2), where=is_there)
    scale = max(float(squares.max()), float(v.max()), TINY)
    shape = (*y.shape[:-2], len(targets))
    low, high = np.full(shape, np.log(1e-12 * scale)), np.full(shape, np.log(1e6 * scale))
    is_zero = _q(y, v, is_there, np.exp(low)) <= targets
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        above = _q(y, v, is_there, np.exp(middle)) > targets
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return np.where(is_zero, 0.0, np.exp(0.5 * (low + high)))


def _group_means(
    values: FloatArray, variances: FloatArray, members: list[IntArray], s2: float
) -> tuple[FloatArray, FloatArray]:
    """Weighted mean (g,) of every group and its variance (g,), at a given σ_u²."""
    y, v, is_there = _padded(values, variances, members)
    weights = np.where(is_there, 1.0 / (v + s2), 0.0)
    total = weights.sum(axis=1)
    return (weights * y).sum(axis=1) / total, 1.0 / total
