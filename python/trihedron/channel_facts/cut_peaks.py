"""Peaks that a limit has cut: readings jump to it and from it further than a smooth peak inside one code would."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.channel_facts.ends import TO_SIGMA, End
from trihedron.quantiles import median

FAR = 0.3
"""Part of an axis' span that lies between a limit and where the sensor mostly is."""
TOP = 3.0
"""Sharper by this much than that parabola falls a peak upon which a tremor rides."""
PAIR_BEND = 8.0
"""Bend, in steps, that two equal samples are allowed: more is no evidence by itself."""
NOISE_JUMP = 5.0
"""Standard deviations of a reading that noise alone may jump at the two ends of a peak's top, in all peaks of a log."""
MOST_RUNS = 1000
"""Runs that are looked at, evenly spread where there are more."""


def is_cut(end: End, *, is_known: bool, is_word: bool = False) -> bool:
    """Some of the runs on an end far from where the axis mostly is are no smooth peak that happens to share a code.

    A parabola of which n samples stay within a step q has a curvature of at most 8 q/((n − 1)² − 1), n even, or
    8 q/(n − 1)², n odd. One sample further it has fallen by half of that times n, two further by that times n + 1;
    a tremor makes it steeper (``TOP``), rounding may add a step, and noise its own jumps. The readings fall by more at
    *both* ends of a run that was cut: a turn at a steady rate begins and ends steeply and meanwhile wavers about its
    extreme. Two equal samples may lie on either side of any peak: they are the limit's only where it ``is_known``
    otherwise, or two peaks end at it. Standing still at the end of a word is the limit's too; on a code that another
    channel ends at as well it may be a table's steady turn one way and the other.
    """
    column = end.column
    if not end.lasts or abs(end.value - end.middle) <= FAR * end.span:
        return False
    runs = end.runs if is_word else end.moving_runs
    runs = runs[np.diff(runs, axis=1)[:, 0] > 1]
    steps = np.abs(np.concatenate([np.diff(part[np.isfinite(part)]) for part in end.stretches]))
    noise = TO_SIGMA * median(steps) / np.sqrt(2.0) if len(steps) else 0.0
    pairs = 0
    for first, stop in runs[:: max(1, -(-len(runs) // MOST_RUNS))].tolist():
        if _falls_on_both_sides(column, first, stop, end.step, noise):
            if is_known or stop - first > 2:
                return True
            pairs += 1
    return pairs > 1


def _falls_on_both_sides(column: FloatArray, first: int, stop: int, step: float, noise: float) -> bool:
    count = stop - first
    bend = TOP * 8.0 / ((count - 1) ** 2 - (1 - count % 2)) if count > 2 else PAIR_BEND
    smooth = step * (1.0 + bend * np.array([0.5 * count, count + 1.0])) + NOISE_JUMP * noise
    sides = (column[stop : stop + 2], column[max(first - 2, 0) : first][::-1])
    return all(np.any(np.abs(side - column[first]) > smooth[: len(side)]) for side in sides if np.isfinite(side).any())
