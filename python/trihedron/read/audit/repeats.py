"""Readings that equal earlier ones: those that equal the previous one, and blocks that a log contains twice."""

import math

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.probability import LN_FAULT
from trihedron.quantiles import quantile

WINDOW = 64
"""Rows of a window."""


class Repeats:
    """Readings that equal the previous one: counts, longest runs and their chance, per axis and for the triad."""

    def __init__(self, readings: FloatArray) -> None:
        self.n = len(readings)
        count, longest, start, windows, self.n_missing, self.first_missing = _core.triad_repeats(readings)
        self.count = np.array(count, dtype=np.int64)
        self.longest = np.array(longest, dtype=np.int64)
        self.longest_start = np.array(start, dtype=np.int64)
        # The last window where it is incomplete counts only where it is the only one.
        width = max(min(WINDOW, self.n - 1), 1)
        self.rates = windows[: max((self.n - 1) // width, 1)] / float(width) if self.n > 1 else np.zeros((1, 4))
        self.starts = WINDOW * np.arange(len(self.rates))

    def chance_outside(self, k: int, start: int, length: int) -> float:
        """Share of equal neighbours on axis ``k`` where they are frequent (ninth decile over windows of 64 rows), in
        the log outside ``length`` rows from ``start``: a channel frozen for half of it is no measure of chance."""
        first = self.starts
        rates = self.rates[(first + WINDOW <= start) | (first >= start + length), k]
        return float(quantile(rates, 0.9)) if len(rates) else 1.0


def longest_by_chance(n: int, probability: float) -> float:
    """Run length of equal neighbours that occurs by chance in n rows in one of a thousand logs."""
    if probability <= 0.0:
        return 4.0
    if probability >= 1.0:
        return float(n)
    return 4.0 - math.log(1000.0 * n) / math.log(probability)


# Blocks of rows that repeat earlier ones exactly: a buffer that was sent twice.

FARTHEST = 1024
"""Most rows between a block and its copy: buffers of sensors and of DMA hold fewer."""


def copied_rows(readings: FloatArray) -> BoolArray:
    """(n,) rows of a triad (n, 3) that repeat different earlier rows one by one.

    A row that equals a single one of the last ``FARTHEST`` equals by chance the one at a given distance once in as many
    rows: with each of a run at one distance the evidence of a copy grows by that.
    """
    least = math.ceil((LN_FAULT + math.log(max(len(readings), 1) * FARTHEST)) / math.log(FARTHEST))
    out = np.zeros(len(readings), dtype=np.bool_)
    for first, stop in _core.triad_copies(readings, FARTHEST, least):
        out[first:stop] = True
    return out
