"""Missing readings: long gaps divide a log, scattered losses change means and spectrum.

The mean of c of m readings scatters about the mean of all m by (1/c - 1/m) s², s² the variance of readings inside the
mean (sampling from a finite population). The transform of a log with the fraction f of its readings has the power
f² S + f (1 - f) h s² (docs/noise.md, eq. 16).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import isotonic_regression

from trihedron.arrays import FloatArray, IntArray
from trihedron.ranges import edges_of, ranges_of

MOST_BRIDGED = 0.02
"""Largest share of missing readings that are bridged by a line; the lost white noise is corrected by scaling."""
SCATTERED_BLOCK = 16
"""Readings per mean with scattered losses: with half of them lost, 1 % of the means have fewer than four."""
LONGEST_SCATTERED = 64
"""Longest run of missing readings that is no gap: with half of all lost at random, 64 in a row have p = 1e-15."""
MOST_SLOW = 3.0
"""Ratio of the variance to that from reading to reading above which a log with losses does not show its fast noise."""
MOST_LOOKS = 8192
"""Most clusters used to estimate the correction for missing readings, which is then accurate to 1 %."""


@dataclass(frozen=True, eq=False)
class Run:
    """Means (k,) of consecutive blocks from number ``first``, the share that is bridged, and the mean of 1/c - 1/m over
    the blocks."""

    first: int
    means: FloatArray
    bridged: float
    sampling: float


def scattered_loss(x: FloatArray) -> float:
    """Share of readings missing outside long gaps."""
    if np.isfinite(np.sum(x)):
        return 0.0
    missing = ~np.isfinite(x)
    rows = np.diff(edges_of(missing), axis=1)
    in_gaps = int(rows[rows > LONGEST_SCATTERED].sum())
    return float((missing.sum() - in_gaps) / max(len(x) - in_gaps, 1))


def slow_over_fast(x: FloatArray) -> float:
    """Variance of readings over half the mean squared difference of neighbours: 1 for white noise."""
    change = np.diff(x)
    fast = 0.5 * float(np.nanmean(np.square(change))) if np.any(np.isfinite(change)) else 0.0
    return float(np.nanvar(x)) / fast if fast > 0.0 else 1.0


def bridged(x: FloatArray) -> FloatArray:
    """Readings with straight lines over scattered losses, which the event detector would take for jumps to the mean.

    Long gaps stay NaN: a line across them would be an event itself.
    """
    gone = ~np.isfinite(x)
    if not gone.any() or gone.all():
        return x
    start, stop = edges_of(gone).T
    short = stop - start <= LONGEST_SCATTERED
    place = np.zeros(len(x) + 1, dtype=np.int64)
    place[start[short]] += 1
    place[stop[short]] -= 1
    fill = np.flatnonzero(np.cumsum(place[:-1]))
    out = x.copy()
    out[fill] = np.interp(fill, np.flatnonzero(~gone), x[~gone])
    return out


def block_means(x: FloatArray, block: int) -> list[Run]:
    """Runs of consecutive block means.

    A block with less than half of the median number of readings is missing. Short (1/64 of the run) and few (5 %)
    missing blocks are bridged by a straight line, which affects only frequencies of that period and above.
    """
    n = len(x) // block
    parts = x[: n * block].reshape(n, block)
    if np.isfinite(np.sum(x)):
        return [Run(0, parts.mean(axis=1) if block > 1 else np.asarray(x), 0.0, 0.0)]
    present = np.isfinite(parts)
    count = present.sum(axis=1)
    means = np.where(present, parts, 0.0).sum(axis=1) / np.maximum(count, 1)
    usual = float(np.median(count[count > 0])) if np.any(count > 0) else float(block)
    hole = 2 * count < usual
    means[hole] = np.nan
    joined: list[tuple[int, int]] = []
    for a, b in ranges_of(~hole):
        if joined and a - joined[-1][1] <= max(3, n // 64) and hole[joined[0][0] : b].mean() < 0.05:
            joined[-1] = (joined[-1][0], b)
        else:
            joined.append((a, b))
    out = []
    for a, b in joined:
        run, gone = means[a:b], hole[a:b]
        sampling = float(np.mean(1.0 / count[a:b][~gone])) - 1.0 / block
        known = run.copy()
        for start, stop in ranges_of(gone):
            # Between the means of as many on either side: an error of theirs is that of white noise over the hole.
            reach = max(stop - start, 4)
            ends = (np.nanmean(side) for side in (known[max(start - reach, 0) : start], known[stop : stop + reach]))
            run[start:stop] = np.interp(np.arange(start, stop), [start - reach / 2, stop + reach / 2], list(ends))
        out.append(Run(a, run, float(gone.mean()), max(sampling, 0.0)))
    return out


def filled(parts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Segments (k, n) less their means with missing readings replaced, and the share (k,) of each that was present.

    Few missing readings are bridged and the segment is scaled for their white noise (1 is returned); scattered ones are
    set to the mean; segments with a long gap are excluded.
    """
    missing = ~np.isfinite(parts)
    if not missing.any():
        return parts - parts.mean(axis=1, keepdims=True), np.ones(len(parts))
    out, shares = [], []
    for row, gone in zip(parts, missing, strict=True):
        share = float(gone.mean())
        if share < MOST_BRIDGED:
            whole = np.interp(np.arange(len(row)), np.flatnonzero(~gone), row[~gone])
            out.append((whole - whole.mean()) / np.sqrt(1.0 - share))
            shares.append(1.0)
        elif share < 0.9 and int(np.diff(edges_of(gone), axis=1).max(initial=0)) <= LONGEST_SCATTERED:
            out.append(np.where(gone, 0.0, row - row[~gone].mean()))
            shares.append(1.0 - share)
    if not out:
        return np.empty((0, parts.shape[1])), np.empty(0)
    return np.stack(out), np.array(shares)


def true_share(x: FloatArray, clusters: IntArray, variance: FloatArray, order: int = 2) -> FloatArray:
    """(k,) ratio of the Allan variance without missing readings to ``variance`` (k,), that of the readings present.

    ``order`` 2 is the Allan, 3 the Hadamard variance. It lies between the ratio of white noise and 1 (slow noise, which
    missing readings do not change); the share of slow noise is non-decreasing along the clusters.
    """
    present = np.isfinite(x)
    if present.all():
        return np.ones(len(clusters))
    level = np.where(present, x, 0.0).sum() / max(int(present.sum()), 1)
    y = np.where(present, x - level, 0.0)
    count, total, square = (np.concatenate([[0.0], np.cumsum(v)]) for v in (present, y, y**2))
    least, slow = np.ones(len(clusters)), np.full(len(clusters), np.nan)
    factors = (1.0, 1.0) if order == 2 else (1.0, 4.0, 1.0)
    for i, m in enumerate(clusters.tolist()):
        last = len(x) - order * m
        if m == 1 or last < 0 or not np.isfinite(variance[i]):
            continue
        starts = np.unique(np.linspace(0, last, min(last + 1, MOST_LOOKS)).astype(np.int64))
        c, s, q = (
            np.stack([v[starts + (k + 1) * m] - v[starts + k * m] for k in range(order)])
            for v in (count, total, square)
        )
        whole = np.all(c > 0, axis=0)
        degrees = float(np.maximum(c - 1, 0)[:, whole].sum())
        if not degrees > 0:
            continue
        within = float((q - s**2 / np.maximum(c, 1.0))[:, whole].sum()) / degrees
        inverse = np.tensordot(factors, 1.0 / c[:, whole], axes=1)
        # Weights as in the variance: the inverse of each term's variance by white noise.
        mean_inverse = len(inverse) / float(np.sum(1.0 / inverse))
        full = sum(factors) / m
        least[i] = full / mean_inverse
        excess = within * (mean_inverse - full) / sum(factors)
        if least[i] < 1.0 - 1e-9:
            slow[i] = np.clip((1.0 - excess / variance[i] - least[i]) / (1.0 - least[i]), 0.0, 1.0)
    known = np.isfinite(slow)
    if not known.any():
        return np.ones(len(clusters))
    slow[known] = isotonic_regression(slow[known], weights=len(x) / clusters[known]).x
    return np.asarray(np.where(known, least + (1.0 - least) * np.where(known, slow, 0.0), 1.0))
