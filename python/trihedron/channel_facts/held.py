"""Readings that a logger wrote again because its sensor had no new one: each is one reading, however often written."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray, IntArray

JUMP_STEPS, JUMP_NOISE = 4.0, 5.0
"""A change from row to row beyond so many steps, and standard deviations of a reading, is motion."""
OFTEN = 0.2
"""Part of the jumps that come after a repeated triad. Three axes of a sensor that moves by steps in every row repeat
together next to never, but in the peaks that all three limits cut at once; a held sensor's do before nearly all."""
FEWEST_JUMPS = 20


def new_readings(readings: FloatArray, noise: FloatArray, step: FloatArray) -> IntArray | None:
    """Rows of a triad (n, 3) that hold a new reading, ``None`` where every row does.

    ``noise`` (3,) of one sample at rest and ``step`` (3,) of the ADC, in the unit of the readings.
    """
    change = np.abs(np.diff(readings, axis=0))
    same = ~np.any(change, axis=1)
    jumps: npt.NDArray[np.intp] = np.flatnonzero(np.any(change > JUMP_STEPS * step + JUMP_NOISE * noise, axis=1))
    jumps = jumps[jumps > 0]
    if len(jumps) < FEWEST_JUMPS or np.mean(same[jumps - 1]) < OFTEN:
        return None
    return np.concatenate([[0], np.flatnonzero(~same) + 1])


def with_repeats(limit_runs: IntArray, rows: IntArray, n: int) -> IntArray:
    """Runs (k, 2) among new readings as runs among all ``n`` rows; ``rows`` are those of the new ones."""
    ends = np.append(rows, n)
    return np.stack([rows[limit_runs[:, 0]], ends[limit_runs[:, 1]]], axis=1)
