"""Readings that equal earlier ones: those that equal the previous one, and blocks that a log contains twice."""

import math

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.quantiles import quantile

CHUNK = 1 << 20
"""Rows after which windows restart."""
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
        # Windows restart every 2²⁰ rows; an incomplete window is used only where it is the only one.
        left = (self.n - 1) % CHUNK
        of_left = windows[-1:] / max(left, 1) if 0 < left < WINDOW else np.zeros((0, 4))
        whole = windows[: (self.n - 1) // WINDOW] / float(WINDOW)
        self.rates = np.concatenate([whole, of_left]) if self.n > 1 else np.zeros((1, 4))
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

FARTHEST, FEWEST_APART, MOST_COPIES = 1024, 2, 3
"""Rows between a block and its copy, at most (buffers of sensors and of DMA) and at least; copies in succession, beyond
which the motion itself is periodic, as in a simulation without noise."""
LN_RARE = math.log(1e4)
"""Logarithm of the prior odds against such a block in a log."""


def copied_blocks(readings: FloatArray) -> BoolArray:
    """(n,) rows of a triad (n, 3) that repeat different earlier rows one by one.

    A row that equals a single one of the last ``FARTHEST`` equals by chance the one at a given distance once in as many
    rows: the evidence of a run at one distance grows by that with each of them.
    """
    out = np.zeros(len(readings), dtype=np.bool_)
    least = LN_RARE + math.log(max(len(readings), 2)) + math.log(FARTHEST)
    for first in range(0, len(readings), CHUNK):
        start = max(first - FARTHEST, 0)
        apart, is_single = _earlier(readings[start : first + CHUNK])
        edges = np.flatnonzero(np.diff(apart, prepend=0, append=0))
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            lag = int(apart[a])
            if lag < FEWEST_APART or is_single[a:b].sum() * math.log(FARTHEST) < least:
                continue
            a, b = _whole_block(readings, start + a, start + b, lag)
            if b - a <= MOST_COPIES * lag:
                out[a:b] = True
    return out


def _whole_block(readings: FloatArray, a: int, b: int, lag: int) -> tuple[int, int]:
    """The block from row a to b with the rows around it that repeat those ``lag`` before, too: others equal them."""
    longest = MOST_COPIES * lag + 1
    while a > lag and b - a < longest and (readings[a - 1] == readings[a - 1 - lag]).all():
        a -= 1
    while b < len(readings) and b - a < longest and (readings[b] == readings[b - lag]).all():
        b += 1
    return a, b


def _earlier(readings: FloatArray) -> tuple[IntArray, BoolArray]:
    """(n,) distance to the last earlier row that is equal, 0 without one near; and whether only one is near."""
    n = len(readings)
    # Rows without a number equal no other.
    words = np.where(np.isfinite(readings), readings + 0.0, np.arange(n)[:, None]).view(np.uint64)
    keys = (words * np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)).sum(axis=1)
    order = np.argsort(keys, kind="stable")
    earlier = np.full(n, -1)
    is_same = (readings[order[1:]] == readings[order[:-1]]).all(axis=1)
    earlier[order[1:][is_same]] = order[:-1][is_same]
    rows = np.arange(n)
    apart = np.where((earlier >= 0) & (rows - earlier <= FARTHEST), rows - earlier, 0)
    second = np.where(earlier >= 0, earlier[earlier], -1)
    return apart, (apart > 0) & ((second < 0) | (rows - second > FARTHEST))
