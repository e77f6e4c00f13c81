"""Readings that equal the one before: how often, how long, and how long chance would make it."""

from __future__ import annotations

import math

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.quantiles import quantile

CHUNK = 1 << 20
"""Rows after which windows begin anew."""
WINDOW = 64
"""Rows of a window."""


class Repeats:
    """Where a reading equals the one before it: counts, longest runs and their chance, per axis and for the triad."""

    def __init__(self, readings: FloatArray) -> None:
        self.n = len(readings)
        count, longest, start, windows, self.n_missing, self.first_missing = _core.triad_repeats(readings)
        self.count = np.array(count, dtype=np.int64)
        self.longest = np.array(longest, dtype=np.int64)
        self.longest_start = np.array(start, dtype=np.int64)
        # Windows begin anew every 2²⁰ rows, and what is left over counts where it is all there is.
        left = (self.n - 1) % CHUNK
        of_left = windows[-1:] / max(left, 1) if 0 < left < WINDOW else np.zeros((0, 4))
        whole = windows[: (self.n - 1) // WINDOW] / float(WINDOW)
        self.rates = np.concatenate([whole, of_left]) if self.n > 1 else np.zeros((1, 4))

    def chance(self, k: int) -> float:
        """Usual share of equal neighbours where they are frequent (ninth decile over windows of 64 rows)."""
        rate = quantile(self.rates[:, k], 0.9)
        return float(rate)


def longest_by_chance(n: int, probability: float) -> float:
    """Longest run of equal neighbours that chance alone gives in n rows once in a thousand logs."""
    if probability <= 0.0:
        return 4.0
    if probability >= 1.0:
        return float(n)
    return 4.0 - math.log(1000.0 * n) / math.log(probability)
