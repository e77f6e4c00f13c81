"""The step of a converter, from the values that occur."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray

MOST_READINGS = 200_000
LEAST_REPEATS = 4
"""Readings to a distinct value below which the steps, if any, are far finer than the noise: they say nothing."""
OFF_GRID = 0.15
"""Share of a step by which a reading may miss its place on the grid: digits of a text file."""


def converter_step(readings: FloatArray) -> float:
    """Step of the grid on which ``readings`` (n,) lie, 0 where there is none or it is far finer than their noise."""
    values = readings[np.isfinite(readings)][:MOST_READINGS]
    distinct = np.unique(values)
    if len(distinct) < 2 or len(distinct) > len(values) / LEAST_REPEATS:
        return 0.0
    gaps = np.diff(distinct)
    # Digits of a text file split a value into several that are all but the same.
    real = gaps[gaps > 0.2 * np.quantile(gaps, 0.5)]
    step = float(np.quantile(real, 0.05))
    for _ in range(4):
        place = np.round((distinct - distinct[0]) / step)
        if place[-1] == 0.0:
            return 0.0
        centred = place - place.mean()
        step = float(centred @ distinct / (centred @ centred))
    off = np.abs((distinct - distinct[0]) / step - np.round((distinct - distinct[0]) / step))
    return step if float(np.quantile(off, 0.95)) < OFF_GRID else 0.0
