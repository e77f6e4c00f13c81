r"""Is a number the same in all sessions, and where does it change? (docs/many-recordings.md)

Per group of numbers (three of an id) the sessions' values y_s with covariance V_s (own error and wander) are held
against one common value: ``H = Σ (y_s - ȳ)ᵀ V_s⁻¹ (y_s - ȳ)``, ``H/(3(n-1)) ~ F(3(n-1), ν)``; Holm's procedure pays for
the ids. Where they differ, the simplest change that leaves the rest alike is named: one session apart, a step at one
place, an even trend; else every session scatters.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.probability import fdtrc
from trihedron.records.sessions import PARAMETERS, Change, ChangeKind, Session

SPREAD_DOF, DRIFT_DOF = 25.0, 5.0
"""Degrees of freedom a session that its covariance and its wander bring: some 25 poses, and half of what was measured
for the wander of a pair of sessions (:mod:`trihedron.diagnose.against.numbers`). An inverse of an estimate is too large
by ν/(ν - 2) on average; the weights of sessions are taken back by it, or ten sessions would be called changed by chance
in 3.5 % of units instead of 1."""
RIDGE = 1e-9
"""Variance, relative to its group's largest, below which a covariance is not told from zero."""


@dataclass(frozen=True)
class _Candidate:
    kind: ChangeKind
    place: int
    column: FloatArray


def changes_among(units: Sequence[Sequence[Session]], *, alpha: float) -> tuple[Change, ...]:
    """One :class:`Change` an id and unit, in the order of the contract; a unit's sessions are in their order in time.

    ``alpha`` is the chance that any id of any unit is called changed where none did: Holm's procedure over all of them.
    Units with a single session are passed over.
    """
    found: list[Change] = []
    for sessions in units:
        if len(sessions) > 1:
            ids = dict.fromkeys(parameter.id for parameter in PARAMETERS[: len(sessions[0].numbers)])
            found += [_change(sessions, name) for name in ids]
    adjusted = np.ones(len(found))
    worst = 0.0
    for rank, k in enumerate(np.argsort([change.p_value for change in found])):
        worst = max(worst, min(1.0, found[k].p_value * (len(found) - rank)))
        adjusted[k] = worst
    return tuple(
        replace(change, p_adjusted=float(p), significant=bool(p < alpha))
        for change, p in zip(found, adjusted, strict=True)
    )


def _change(sessions: Sequence[Session], name: str) -> Change:
    picked = [k for k, parameter in enumerate(PARAMETERS) if parameter.id == name]
    values = np.array([session.numbers[picked] for session in sessions])
    # The wander of one session is read off few poses: that of the unit is the mean over its sessions.
    drift = np.mean([session.drift[picked] for session in sessions], axis=0)
    weights = np.array([_weight(session, picked, drift) for session in sessions])
    names = tuple(PARAMETERS[k].name for k in picked)
    p_value, values, weights, name, names = _as_gravity(name, names, values, weights)
    best, rest_p = _best(values, weights, name)
    kind: ChangeKind = best.kind if best is not None else "differs"
    if best is not None and len(sessions) > 2 and rest_p < MIN_REST_P and not _stands_out(values, weights, best):
        kind = "scatter"
    size, std = np.zeros(len(names)), np.zeros(len(names))
    where = ""
    if best is not None and kind != "scatter":
        coefficients, covariance = _solved(values, weights, best.column)
        size, std = coefficients[len(names) :], np.sqrt(np.diag(covariance)[len(names) :])
        where = sessions[best.place].name if kind != "trend" else ""
    elif kind == "scatter":
        size = values.std(axis=0, ddof=1)
        std = np.sqrt(np.mean([np.diag(np.linalg.inv(w)) for w in weights], axis=0))
    unit = PARAMETERS[picked[0]].unit
    return Change(
        name, sessions[0].group, kind, where, names, tuple(map(float, size)), tuple(map(float, std)), unit,
        p_value, 1.0, False,
    )  # fmt: skip


MIN_REST_P = 0.01
"""What is left after the change named may be chance: at 1 % one change in a hundred is called scatter instead."""


def _weight(session: Session, picked: list[int], drift: FloatArray) -> FloatArray:
    covariance = session.covariance[np.ix_(picked, picked)] + np.diag(drift)
    ridge = RIDGE * max(float(np.trace(covariance)) / len(picked), 1e-300)
    shrunk = (SPREAD_DOF - 2.0) / SPREAD_DOF
    return np.asarray(shrunk * np.linalg.inv(covariance + ridge * np.eye(len(picked))), dtype=np.float64)


def _dof(name: str, n_sessions: int) -> float:
    return n_sessions * (DRIFT_DOF if name.endswith("bias") else SPREAD_DOF)


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
    return max(fdtrc(dof, _dof(name, n_sessions), statistic / dof), 1e-300)


def _candidates(n: int) -> Iterator[_Candidate]:
    """One session apart, then steps that leave two on either side, then an even trend."""
    if n == 2:
        yield _Candidate("differs", 1, np.array([0.0, 1.0]))
        return
    for k in range(n):
        yield _Candidate("apart", k, np.eye(n)[k])
    for k in range(2, n - 1):
        yield _Candidate("step", k, (np.arange(n) >= k).astype(np.float64))
    if n > 3:
        yield _Candidate("trend", 0, np.linspace(-0.5 * (n - 1), 0.5 * (n - 1), n))


def _best(values: FloatArray, weights: FloatArray, name: str) -> tuple[_Candidate | None, float]:
    """The candidate that leaves least, and how well the rest then agrees."""
    n, k = values.shape
    left = [(_left(values, weights, candidate.column), candidate) for candidate in _candidates(n)]
    least, best = min(left, key=lambda pair: pair[0])
    dof = k * (n - 2)
    return best, 1.0 if dof <= 0 else _p(least, dof, name, n)


def _stands_out(values: FloatArray, weights: FloatArray, best: _Candidate) -> bool:
    """Whether a change stands out of the scatter of the rest, however large that is; the search is paid for."""
    n, k = values.shape
    dof = k * (n - 2)
    if n < 4:
        return False
    before, after = _left(values, weights, None), _left(values, weights, best.column)
    ratio = ((before - after) / k) / max(after / dof, 1e-300)
    return fdtrc(k, dof, ratio) * len(list(_candidates(n))) < MIN_REST_P


def _as_gravity(
    name: str, names: tuple[str, ...], values: FloatArray, weights: FloatArray
) -> tuple[float, FloatArray, FloatArray, str, tuple[str, ...]]:
    """p of one common value; accelerometer scales that change alike on all axes are gravity, one number a session."""
    n, k = values.shape
    p_value = _p(_left(values, weights, None), k * (n - 1), name, n)
    if name != "accel-scale" or p_value >= MIN_REST_P:
        return p_value, values, weights, name, names
    ones = np.ones(k)
    variance = np.array([1.0 / float(ones @ w @ ones) for w in weights])
    common = np.array([v * float(ones @ w @ y) for v, w, y in zip(variance, weights, values, strict=True)])
    # What each axis has beside the common scale of its session is alike in all sessions: two numbers each.
    shape = values - common[:, None]
    if _p(_left(shape, weights, None), (k - 1) * (n - 1), name, n) < MIN_REST_P:
        return p_value, values, weights, name, names
    return p_value, common[:, None], (1.0 / variance)[:, None, None], "gravity", ("common scale",)
