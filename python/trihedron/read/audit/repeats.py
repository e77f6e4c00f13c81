"""Readings that equal the one before: how often, how long, and how long chance would make it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from trihedron.read.table import FloatArray

CHUNK = 1 << 20
"""Rows per pass: the audit's own memory stays at a few 8 MB arrays whatever the length of the log."""


class Repeats:
    """Where a reading equals the one before it: counts, longest runs and their chance, per axis and for the triad."""

    def __init__(self, readings: FloatArray) -> None:
        n = len(readings)
        self.n = n
        self.count = np.zeros(4, dtype=np.int64)
        self.longest = np.ones(4, dtype=np.int64)
        self.longest_start = np.zeros(4, dtype=np.int64)
        run = np.ones(4, dtype=np.int64)
        rates: list[FloatArray] = []
        for start in range(1, n, CHUNK):
            stop = min(start + CHUNK, n)
            same = np.empty((stop - start, 4), dtype=bool)
            np.equal(readings[start:stop], readings[start - 1 : stop - 1], out=same[:, :3])
            same[:, 3] = same[:, 0] & same[:, 1] & same[:, 2]
            self.count += same.sum(axis=0)
            rates.append(_window_rates(same))
            for k in range(4):
                run[k] = self._runs(k, same[:, k], start, int(run[k]))
        self.rates = np.concatenate(rates) if rates else np.zeros((1, 4))

    def _runs(self, k: int, same: npt.NDArray[np.bool_], start: int, open_run: int) -> int:
        """Longest run of equal readings; a run may continue from the chunk before."""
        breaks = np.flatnonzero(~same)
        edges = np.concatenate([[-1], breaks, [len(same)]])
        lengths = np.diff(edges)
        lengths[0] += open_run - 1
        best = int(np.argmax(lengths))
        if lengths[best] > self.longest[k]:
            self.longest[k] = lengths[best]
            first = start + int(edges[best])
            self.longest_start[k] = first - (open_run - 1) if best == 0 else first
        return int(lengths[-1])

    def chance(self, k: int) -> float:
        """Usual share of equal neighbours where they are frequent (ninth decile over windows of 64 rows)."""
        rate: np.float64 = np.percentile(self.rates[:, k], 90.0)
        return float(rate)


def _window_rates(same: npt.NDArray[np.bool_]) -> FloatArray:
    length = 64
    whole = len(same) // length
    if whole == 0:
        return np.asarray(same.mean(axis=0, keepdims=True), dtype=np.float64)
    blocks = same[: whole * length].reshape(whole, length, 4)
    return np.asarray(blocks.mean(axis=1), dtype=np.float64)


def longest_by_chance(n: int, probability: float) -> float:
    """Longest run of equal neighbours that chance alone gives in n rows once in a thousand logs."""
    if probability <= 0.0:
        return 4.0
    if probability >= 1.0:
        return float(n)
    return 4.0 - math.log(1000.0 * n) / math.log(probability)
