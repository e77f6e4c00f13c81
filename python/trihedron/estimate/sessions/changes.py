r"""Test whether a parameter is the same in all sessions, and where it changes (docs/many-recordings.md).

Per group of parameters (three of an id) the sessions' values y_s with covariance V_s (own error and bias drift) are
tested against one common value: ``H = Σ (y_s - ȳ)ᵀ V_s⁻¹ (y_s - ȳ)``, ``H/(3(n-1)) ~ F(3(n-1), ν)``; Holm's procedure
corrects for the number of ids. Where they differ, the simplest change after which the rest agrees is reported: one
session apart, a step at one place, an even trend; else scatter.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.defaults import FALSE_ALARM
from trihedron.probability import fdtrc, ndtr
from trihedron.records import Calibration, Segments
from trihedron.records.sessions import GEOMETRY, ONE_UNIT, PARAMETERS, Change, ChangeKind, Session
from trihedron.transforms import directions_of

SPREAD_DOF, DRIFT_DOF = 25.0, 5.0
"""Degrees of freedom per session of its covariance and of its bias drift: some 25 poses, and half of that measured for
the drift of a pair of sessions, which scatters by 70 % (28 simulated sessions of 20 to 32 poses). The inverse of an
estimated covariance is too large by ν/(ν - 2) on average; the weights are reduced by it, or 3.5 % of units with ten
sessions would be reported as changed instead of 1 %."""
RIDGE = 1e-9
"""Variance added to the diagonal, relative to the mean variance, so that a singular covariance can be inverted."""


Candidate = tuple[ChangeKind, int, FloatArray]
"""Kind of a change, the session at which it begins, and its course over the sessions (n,)."""


def bias_drift(calibration: Calibration, segments: Segments, n: int) -> FloatArray:
    """Variance (n,) of the bias change between two sessions like the calibrated one (eq. 9.3), 0 for other parameters,
    in the order of :data:`trihedron.records.sessions.PARAMETERS`."""
    out = np.zeros(n)
    accel, gyro = calibration.accelerometer, calibration.gyroscope
    quality = accel.quality
    if quality is not None and segments.accelerometer_mean is not None and len(quality.residual) > 3:
        up = directions_of(segments.accelerometer_mean @ accel.S.T + accel.b)
        if len(up) == len(quality.residual):
            out[:3] = between_sessions(quality.residual, quality.sigma**2, np.einsum("ij,ij->i", up[1:], up[:-1]))
    if gyro is not None and segments.gyroscope_mean is not None and segments.gyroscope_sigma_mean is not None:
        biases = segments.gyroscope_mean @ gyro.S.T
        noise = (segments.gyroscope_sigma_mean**2) @ (gyro.S**2).T
        is_seen = np.all(np.isfinite(biases) & np.isfinite(noise), axis=1)
        if is_seen.sum() > 3:
            biases, noise = biases[is_seen] - biases[is_seen].mean(axis=0), noise[is_seen]
            out[9:12] = np.mean([between_sessions(biases[:, k], noise[:, k]) for k in range(3)])
    return out


def between_sessions(away: FloatArray, noise: FloatArray, alike: FloatArray | float = 1.0) -> float:
    """Variance of the bias change between two sessions from the biases of n poses about their mean (eq. 9.3).

    ``2 C₁ + (V - C₁)/n``, V the variance of ``away`` (n,) or (n, axes) beyond the variance ``noise``, C₁ the covariance
    of neighbours, the cosine of whose verticals is ``alike``: between two sessions 1/f noise differs by twice its
    variance within one.
    """
    n = len(away)
    total = max(float((away**2).sum()) / (away.size - away.size / n) - float(np.mean(noise)), 0.0)
    weight = np.broadcast_to(alike, away[1:].shape)
    # Subtracting the mean makes neighbours anticorrelated by variance/n, which is added back.
    shared = float((away[1:] * away[:-1] * weight).sum() / max((weight**2).sum(), TINY)) + float(np.mean(away**2)) / n
    shared = min(max(shared, 0.0), total)
    return 2.0 * shared + (total - shared) / n


def changes_among(units: Sequence[Sequence[Session]], *, alpha: float) -> tuple[Change, ...]:
    """One :class:`Change` per id and unit, in the order of ``PARAMETERS``; a unit's sessions are in order of time.

    ``alpha`` is the probability that any id of any unit without a change is significant: Holm's procedure over all.
    Units with a single session are skipped.
    """
    found: list[Change] = []
    for sessions in units:
        if len(sessions) > 1:
            ids = dict.fromkeys(parameter.id for parameter in PARAMETERS[: len(sessions[0].numbers)])
            found += [_change(sessions, name) for name in ids]
    adjusted = holm([change.p_value for change in found])
    return tuple(
        replace(change, p_adjusted=float(p), significant=bool(p < alpha))
        for change, p in zip(found, adjusted, strict=True)
    )


def holm(p_values: Sequence[float] | FloatArray) -> FloatArray:
    """(n,) p-values adjusted for as many tests by Holm's procedure."""
    p, adjusted = np.asarray(p_values, dtype=np.float64), np.ones(len(p_values))
    order = np.argsort(p)
    adjusted[order] = np.minimum(np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)), 1.0)
    return adjusted


def _change(sessions: Sequence[Session], name: str) -> Change:
    picked = [k for k, parameter in enumerate(PARAMETERS) if parameter.id == name]
    values = np.array([session.numbers[picked] for session in sessions])
    # The bias drift of one session is estimated from few poses: the mean over the unit's sessions is used.
    drift = np.mean([session.drift[picked] for session in sessions], axis=0)
    weights = np.array([_weight(session, picked, drift) for session in sessions])
    names = tuple(PARAMETERS[k].name for k in picked)
    p_value, values, weights, name, names = _as_common_scale(name, names, values, weights)
    (kind, place, column), rest_p = _best(values, weights, name)
    if len(sessions) > 2 and rest_p < MIN_REST_P and not _stands_out(values, weights, column):
        kind = "scatter"
        size = values.std(axis=0, ddof=1)
        std = np.sqrt(np.mean([np.diag(np.linalg.inv(w)) for w in weights], axis=0))
    else:
        coefficients, covariance = _solved(values, weights, column)
        size, std = coefficients[len(names) :], np.sqrt(np.diag(covariance)[len(names) :])
    where = "" if kind in ("scatter", "trend") else sessions[place].name
    unit = PARAMETERS[picked[0]].unit
    return Change(
        name, sessions[0].group, kind, where, names, tuple(map(float, size)), tuple(map(float, std)), unit,
        p_value, 1.0, False,
    )  # fmt: skip


MIN_REST_P = 0.01
"""p-value of the rest after the reported change, below which it is scatter: 1 % of true changes are called scatter."""


def _weight(session: Session, picked: list[int], drift: FloatArray) -> FloatArray:
    covariance = session.covariance[np.ix_(picked, picked)] + np.diag(drift)
    ridge = RIDGE * max(float(np.trace(covariance)) / len(picked), TINY)
    shrunk = (SPREAD_DOF - 2.0) / SPREAD_DOF
    return np.asarray(shrunk * np.linalg.inv(covariance + ridge * np.eye(len(picked))), dtype=np.float64)


def _left(values: FloatArray, weights: FloatArray, column: FloatArray | None) -> float:
    """H about a common value, or about a common value and a change along ``column`` (n,)."""
    k = values.shape[1]
    coefficients, _ = _solved(values, weights, column)
    model = np.tile(coefficients[:k], (len(values), 1))
    if column is not None:
        model = model + column[:, None] * coefficients[k:]
    away = values - model
    return float(np.einsum("si,sij,sj->", away, weights, away))


def _solved(values: FloatArray, weights: FloatArray, column: FloatArray | None) -> tuple[FloatArray, FloatArray]:
    k = values.shape[1]
    columns = np.ones((len(values), 1)) if column is None else np.column_stack([np.ones(len(values)), column])
    weighed = columns[:, :, None, None] * weights[:, None, :, :]
    normal = np.einsum("scij,sd->cidj", weighed, columns).reshape(k * columns.shape[1], -1)
    right = np.einsum("scij,sj->ci", weighed, values).ravel()
    covariance: FloatArray = np.linalg.inv(normal)
    return covariance @ right, covariance


def _p(statistic: float, dof: int, name: str, n_sessions: int) -> float:
    of_weights = n_sessions * (DRIFT_DOF if name.endswith("bias") else SPREAD_DOF)
    return max(fdtrc(dof, of_weights, statistic / dof), TINY)


def _candidates(n: int) -> Iterator[Candidate]:
    """Candidates for n sessions: one session apart, then steps with two or more on either side, then an even trend."""
    if n == 2:
        yield "differs", 1, np.array([0.0, 1.0])
        return
    for k in range(n):
        yield "apart", k, np.eye(n)[k]
    for k in range(2, n - 1):
        yield "step", k, (np.arange(n) >= k).astype(np.float64)
    if n > 3:
        yield "trend", 0, np.linspace(-0.5 * (n - 1), 0.5 * (n - 1), n)


def _best(values: FloatArray, weights: FloatArray, name: str) -> tuple[Candidate, float]:
    """The candidate with the least H after it, and the p-value of that rest."""
    n, k = values.shape
    left = [(_left(values, weights, candidate[2]), candidate) for candidate in _candidates(n)]
    least, best = min(left, key=lambda pair: pair[0])
    dof = k * (n - 2)
    return best, 1.0 if dof <= 0 else _p(least, dof, name, n)


def _stands_out(values: FloatArray, weights: FloatArray, column: FloatArray) -> bool:
    """Whether a change exceeds the scatter of the rest (F test), corrected for the number of candidates."""
    n, k = values.shape
    dof = k * (n - 2)
    if n < 3:
        return False
    before, after = _left(values, weights, None), _left(values, weights, column)
    ratio = ((before - after) / k) / max(after / dof, TINY)
    return fdtrc(k, dof, ratio) * len(list(_candidates(n))) < MIN_REST_P


SHARE = 0.05
"""Largest change of one axis against the others, relative to the common one, that is no change of its own."""


def _as_common_scale(
    name: str, names: tuple[str, ...], values: FloatArray, weights: FloatArray
) -> tuple[float, FloatArray, FloatArray, str, tuple[str, ...]]:
    """p of one common value; scales that change equally on all axes (unit, gravity, clock) are one value a session."""
    n, k = values.shape
    p_value = _p(_left(values, weights, None), k * (n - 1), name, n)
    if not name.endswith("-scale") or p_value >= MIN_REST_P:
        return p_value, values, weights, name, names
    # Scales of the axes differ: without their means, other weights of the axes would be another common scale.
    values, ones = values - values.mean(axis=0), np.ones(k)
    variance = np.array([1.0 / float(ones @ w @ ones) for w in weights])
    common = np.array([v * float(ones @ w @ y) for v, w, y in zip(variance, weights, values, strict=True)])
    # Only if the scales relative to the session's common one are equal in all sessions (k - 1 dof each), or nearly so.
    shape = values - common[:, None]
    is_alike = bool(np.max(np.ptp(shape, axis=0)) < SHARE * np.ptp(common))
    if not is_alike and _p(_left(shape, weights, None), (k - 1) * (n - 1), name, n) < MIN_REST_P:
        return p_value, values, weights, name, names
    common_name = name.replace("-scale", "-common-scale")
    return p_value, common[:, None], (1.0 / variance)[:, None, None], common_name, ("all axes",)


def of_another_unit(sessions: Sequence[Session], changes: Sequence[Change]) -> tuple[Change, ...]:
    """Significant ``changes`` of the sessions that one unit does not make, the most significant first: of a
    misalignment, or of a scale by more than ``ONE_UNIT``.

    A scale common to all axes is not among them: a unit of measurement or a clock changes it as well.
    """
    apart = {*GEOMETRY, *_beyond_one_unit(sessions)}
    return tuple(sorted((c for c in changes if c.significant and c.id in apart), key=lambda c: c.p_adjusted))


def _beyond_one_unit(sessions: Sequence[Session]) -> set[str]:
    """Ids of scales and axis angles of which two sessions differ significantly by more than ``ONE_UNIT``."""
    fixed = [k for k, one in enumerate(PARAMETERS[: len(sessions[0].numbers)]) if not one.id.endswith("bias")]
    pairs = list(combinations(sessions, 2))
    found = set()
    for a, b in pairs:
        for k in fixed:
            away = float(abs(a.numbers[k] - b.numbers[k]))
            sigma = float(np.sqrt(max(a.covariance[k, k] + b.covariance[k, k], TINY)))
            if ndtr(-(away - ONE_UNIT) / sigma) * len(pairs) * len(fixed) < FALSE_ALARM:
                found.add(PARAMETERS[k].id)
    return found
