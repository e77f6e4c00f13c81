"""Motion beyond a sensor's range, as far as the readings before and after it tell."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from trihedron.arrays import BoolArray, FloatArray
from trihedron.records.channel_facts import ChannelFacts

SLOPE_OVER = 2
"""Samples on either side over which the slope into a cut peak is taken: fewer are noise, more the next bend."""


def unclipped(readings: FloatArray, facts: ChannelFacts) -> FloatArray:
    """(n, 3) readings with the peaks that a limit cut off drawn again, raw units.

    A cubic through the last reading before and the first after a run at the limit, with their slopes; never inside the
    limit, never further beyond it than the limit is from the middle of the log. What was cut is a guess; that the
    motion went beyond is not.
    """
    if not facts.limits:
        return readings
    out = readings.copy()
    last = len(readings) - 1
    at_limits = facts.at_limits(len(readings))
    for limit in facts.limits:
        column = readings[:, limit.axis]
        at_limit = at_limits[:, limit.axis]
        away = abs(limit.value - float(np.nanmedian(column)))
        sign = 1.0 if limit.is_high else -1.0
        for first, stop in limit.runs.tolist():
            a, b = first - 1, stop
            if a < 0 or b > last or at_limit[a] or at_limit[b]:
                continue
            rise = _slope(column, at_limit, a, -1)
            fall = _slope(column, at_limit, b, 1)
            # Seen from the limit outward: a peak is entered upwards and left downwards, or there was none.
            slopes = [max(sign * rise, 0.0) * sign, min(sign * fall, 0.0) * sign]
            curve = CubicHermiteSpline([a, b], [column[a], column[b]], slopes)
            beyond = sign * (curve(np.arange(first, stop)) - limit.value)
            out[first:stop, limit.axis] = limit.value + sign * np.clip(beyond, 0.0, away)
    return out


def _slope(column: FloatArray, at_limit: BoolArray, place: int, step: int) -> float:
    """Slope [raw/sample] at ``place``, from readings on its side that lie at no limit."""
    other = place
    for _ in range(SLOPE_OVER):
        if not 0 <= other + step < len(column) or at_limit[other + step]:
            break
        other += step
    return 0.0 if other == place else float((column[other] - column[place]) / (other - place))
