r"""Parameters as functions of temperature, from sessions at different temperatures (docs/many-recordings.md).

Each parameter is a polynomial ``Σ c_p (T - T₀)^p`` plus a random difference per session; the order of each group of
three is chosen by cross-validation over sessions. Where sessions were recorded while heating and while cooling, half
the difference between both branches is tested too.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.estimate.sessions.spread import spread_within
from trihedron.probability import fdtrc
from trihedron.records.sessions import PARAMETERS, Session, Spread, ThermalModel, ThermalTerm

MAX_ORDER = 3
SPARE = 2
"""Sessions needed beyond the coefficients of a polynomial: without one of them a degree of freedom must remain."""
GAIN = 6.0
"""Gain of the held-out score (twice a log likelihood, three parameters together) that a higher order needs. With 6, a
group that does not depend on temperature gets an order in 1 % of cases."""
HYSTERESIS_P = 0.01 / 7.0
"""p-value of hysteresis: a false alarm in 1 % of units, over the seven groups."""
MIN_SPAN_DEGC = 2.0
"""Least temperature range of the sessions: the thermometer of a part differs from its sensor by as much."""


def thermal_model(sessions: Sequence[Session]) -> ThermalModel:
    """The thermal model of sessions that all have a temperature.

    Raises ``InputError`` where temperatures are missing, or within ``MIN_SPAN_DEGC``.
    """
    T = np.array([session.temperature_degc for session in sessions])
    if not np.all(np.isfinite(T)):
        missing = [session.name for session in sessions if not np.isfinite(session.temperature_degc)]
        raise InputError(f"{missing[0]}: no temperature was logged; log it, or leave this recording out.")
    if np.ptp(T) < MIN_SPAN_DEGC:
        raise InputError(
            f"all recordings were made within {np.ptp(T):.1f} °C: they do not show what temperature does; record at "
            "temperatures 10 °C apart or more."
        )
    low = min(session.temperature_range_degc[0] for session in sessions)
    high = max(session.temperature_range_degc[1] for session in sessions)
    reference = float(np.mean(T))
    branch = np.array([float(session.branch) for session in sessions])
    ids = list(dict.fromkeys(parameter.id for parameter in PARAMETERS[: len(sessions[0].numbers)]))
    terms = tuple(_term(sessions, name, T - reference, branch) for name in ids)
    return ThermalModel(reference, float(low), float(high), terms)


def _term(sessions: Sequence[Session], name: str, t: FloatArray, branch: FloatArray) -> ThermalTerm:
    picked = [k for k, parameter in enumerate(PARAMETERS) if parameter.id == name]
    values = np.array([session.numbers[picked] for session in sessions])
    variances = np.array([np.diag(session.covariance)[picked] for session in sessions])
    scale = max(float(np.abs(t).max()), 1e-9)
    distinct = len(np.unique(np.round(t / scale, 2)))
    highest = min(MAX_ORDER, len(t) - 1 - SPARE, distinct - 1)
    scores = [_held_out(values, variances, _columns(t / scale, order)) for order in range(max(highest, 0) + 1)]
    order = 0
    for candidate in range(1, len(scores)):
        if scores[candidate] > scores[order] + GAIN:
            order = candidate
    columns = _columns(t / scale, order)
    hysteresis = None
    if min(np.sum(branch > 0), np.sum(branch < 0)) >= 2 and len(t) - order - 2 >= SPARE:
        hysteresis, p_value = _branches(values, variances, columns, branch)
        if p_value >= HYSTERESIS_P:
            hysteresis = None
    if hysteresis is not None:
        columns = np.column_stack([columns, branch])
    fits = [_fit(values[:, axis], variances[:, axis], columns) for axis in range(values.shape[1])]
    powers = scale ** -np.arange(order + 1)
    coefficients = np.column_stack([fit[0][: order + 1] * powers for fit in fits])
    covariance = np.array([np.outer(powers, powers) * fit[1][: order + 1, : order + 1] for fit in fits])
    if hysteresis is not None:
        hysteresis = np.array([fit[0][order + 1] for fit in fits])
    remaining = tuple(_remaining(values[:, axis], variances[:, axis], columns) for axis in range(values.shape[1]))
    return ThermalTerm(name, order, coefficients, covariance, remaining, hysteresis)


def _columns(t: FloatArray, order: int) -> FloatArray:
    return t[:, None] ** np.arange(order + 1)


def _fit(y: FloatArray, v: FloatArray, X: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Coefficients, their covariance, and the variance σ² between sessions for which Σ r²/(σ² + v) equals its dof."""
    dof = len(y) - X.shape[1]

    def solve(s2: float) -> tuple[FloatArray, FloatArray, float]:
        w = 1.0 / (v + s2)
        covariance = np.asarray(np.linalg.inv((X.T * w) @ X))
        c = covariance @ ((X.T * w) @ y)
        return c, covariance, float(np.sum(w * (y - X @ c) ** 2))

    c, covariance, q = solve(0.0)
    if dof < 1 or q <= dof:
        return c, covariance, 0.0
    most = float(np.var(y)) * len(y) + float(v.max())
    s2 = float(brentq(lambda s2: solve(s2)[2] - dof, 0.0, most, xtol=1e-12 * most))
    c, covariance, _ = solve(s2)
    return c, covariance, s2


def _held_out(values: FloatArray, variances: FloatArray, X: FloatArray) -> float:
    """Twice the log predictive density of all sessions, each by the fit of the others, as Student's t."""
    n = len(values)
    total = 0.0
    for left in range(n):
        kept = np.arange(n) != left
        if np.linalg.matrix_rank(X[kept]) < X.shape[1]:
            return -np.inf
        nu = float(kept.sum() - X.shape[1])
        for axis in range(values.shape[1]):
            c, covariance, s2 = _fit(values[kept, axis], variances[kept, axis], X[kept])
            spread = float(variances[left, axis] + s2 + X[left] @ covariance @ X[left])
            z2 = float(values[left, axis] - X[left] @ c) ** 2 / spread
            total -= (nu + 1.0) * float(np.log1p(z2 / nu)) + float(np.log(spread))
    return total


def _branches(values: FloatArray, variances: FloatArray, X: FloatArray, branch: FloatArray) -> tuple[FloatArray, float]:
    """Half the difference of both branches, and p of the F test on all axes together against the sessions' scatter."""
    n, k = values.shape
    wide = np.column_stack([X, branch])
    dof = n - wide.shape[1]
    gain = left = 0.0
    size = []
    for axis in range(k):
        c, _, s2 = _fit(values[:, axis], variances[:, axis], wide)
        w = 1.0 / (variances[:, axis] + s2)
        narrow = np.linalg.lstsq(X * np.sqrt(w)[:, None], values[:, axis] * np.sqrt(w), rcond=None)[0]
        after = float(np.sum(w * (values[:, axis] - wide @ c) ** 2))
        gain += float(np.sum(w * (values[:, axis] - X @ narrow) ** 2)) - after
        left += after
        size.append(float(c[-1]))
    # The scatter is at least that of the sessions' own uncertainties.
    ratio = (gain / k) / max(left / (k * dof), 1.0)
    return np.array(size), fdtrc(k, k * dof, ratio)


def _remaining(y: FloatArray, v: FloatArray, X: FloatArray) -> Spread:
    """Spread of sessions about the fit: that of the residuals, scaled for the degrees of freedom of the fit."""
    c, _, s2 = _fit(y, v, X)
    residual = y - X @ c
    dof = max(len(y) - X.shape[1], 1)
    inflated = residual * np.sqrt((len(y) - 1) / dof)
    spread = spread_within(inflated, v, [""] * len(y))
    assert spread is not None
    return Spread(float(np.sqrt(s2)), min(spread.low, float(np.sqrt(s2))), max(spread.high, float(np.sqrt(s2))), dof)
