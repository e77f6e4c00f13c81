"""Readings that come late: what a delay and a low-pass add, to all orders that a recording can tell.

A reading y that trails the truth x by a pure delay δ has x(t) = y(t + δ); behind a low-pass of first order
x = y + τ y', of second order (Butterworth) x = y + τ y' + τ²/2 y''. All three begin with τ y': what tells them apart is
the next term. Columns are made for a time of a grid and scale with its parameter, which must come out near one.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from scipy.linalg import solve_banded

from trihedron.diagnose.context import Context
from trihedron.diagnose.session.observations import FloatArray

TIMES_S = (0.004, 0.008, 0.016, 0.032, 0.064)
"""Times tried, each twice the one before: a parameter between 1/√2 and √2 of its own covers all between."""
NEAR_ONE = (0.6, 1.6)
"""A time that its own column does not confirm: the next of the grid fits better, or the mechanism does not."""


def times_for(context: Context) -> tuple[float, ...]:
    """The times of the grid that the sampling resolves: half a sample at least."""
    step_s = 1.0 / context.obs.recording.rate_hz
    return tuple(t for t in TIMES_S if t >= 0.25 * step_s) or (TIMES_S[-1],)


def shifted(context: Context, values: FloatArray, ahead_s: float) -> FloatArray:
    """(points, 3) values read ``ahead_s`` later inside moves, their ends held; unchanged in holds.

    By the cubic spline with level ends of every move: a straight line between samples would be a low-pass of its own.
    """
    out = values.copy()
    if not context.moves:
        return out
    slope = _spline_slopes(context, values)
    first = context.moves[0].start
    t = context.time_s
    for where in context.moves:
        own = t[where]
        at = np.clip(own + ahead_s, own[0], own[-1])
        k = np.clip(np.searchsorted(own, at, side="right") - 1, 0, len(own) - 2) + where.start
        h = (t[k + 1] - t[k])[:, None]
        x = (at - t[k])[:, None] / h
        d0, d1 = slope[k - first] * h, slope[k + 1 - first] * h
        rise = values[k + 1] - values[k]
        # Hermite's cubic about its left end.
        out[where] = values[k] + x * (d0 + x * (3.0 * rise - 2.0 * d0 - d1 + x * (d0 + d1 - 2.0 * rise)))
    return out


_SLOPES: WeakKeyDictionary[Context, list[tuple[FloatArray, FloatArray]]] = WeakKeyDictionary()


def _spline_slopes(context: Context, values: FloatArray) -> FloatArray:
    """(move samples, 3) slopes of the splines at their knots, all moves in one banded system; kept for these values."""
    known = _SLOPES.setdefault(context, [])
    for given, slope in known:
        if given is values:
            return slope
    first = context.moves[0].start
    y, t = values[first:], context.time_s[first:]
    n = len(y)
    band, right = np.zeros((3, n)), np.zeros((n, 3))
    band[1] = 1.0
    h = np.diff(t)
    inner = np.ones(n, dtype=bool)
    for where in context.moves:
        inner[[where.start - first, where.stop - 1 - first]] = False
    k = np.flatnonzero(inner)
    # Continuous curvature at inner knots; ends are level.
    band[2, k - 1], band[1, k], band[0, k + 1] = h[k], 2.0 * (h[k - 1] + h[k]), h[k - 1]
    left, after = (y[k] - y[k - 1]) / h[k - 1][:, None], (y[k + 1] - y[k]) / h[k][:, None]
    right[k] = 3.0 * (h[k][:, None] * left + h[k - 1][:, None] * after)
    found: FloatArray = solve_banded((1, 1), band, right)
    known.append((values, found))
    return found


def by_delay(context: Context, values: FloatArray, delay_s: float) -> FloatArray:
    """What a delay adds to readings: y(t) - y(t + δ)."""
    return values - shifted(context, values, delay_s)


def by_low_pass(context: Context, values: FloatArray, time_s: float) -> FloatArray:
    """What a second-order low-pass of this delay adds to readings: -(τ y' + τ²/2 y'')."""
    step = max(0.5 * time_s, 1.0 / context.obs.recording.rate_hz)
    twice = shifted(context, values, step) - 2.0 * values + shifted(context, values, -step)
    out: FloatArray = -(time_s * context.derivative(values) + 0.5 * (time_s / step) ** 2 * twice)
    return out


def is_confirmed(value: FloatArray, covariance: FloatArray) -> bool:
    """Whether a scaled parameter is near one, within three standard errors."""
    sigma = 3.0 * float(np.sqrt(max(float(covariance[0, 0]), 0.0)))
    return bool(NEAR_ONE[0] - sigma < value[0] < NEAR_ONE[1] + sigma and value[0] > 0.0)
