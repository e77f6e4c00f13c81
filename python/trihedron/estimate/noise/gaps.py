"""Missing readings: long gaps divide a log, scattered losses change means and spectrum.

The mean of c of m readings scatters about the mean of all m by (1/c - 1/m) s², s² the variance of readings inside the
mean (sampling from a finite population). The transform of a log with the fraction f of its readings has the power
f² S + f (1 - f) h s² (docs/noise.md, eq. 16).
"""

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.ranges import edges_of, ranges_of

MOST_BRIDGED = 0.02
"""Largest share of missing readings that are bridged by a line; the lost white noise is corrected by scaling."""
SCATTERED_BLOCK = 16
"""Readings per mean with scattered losses: with half of them lost, 1 % of the means have fewer than four."""
LONGEST_SCATTERED = 64
"""Longest run of missing readings that is no gap: with half of all lost at random, 64 in a row have p = 1e-15."""
MOST_SLOW = 3.0
"""Ratio of the variance to that from reading to reading above which a log with losses does not show its fast noise."""


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
    out = np.interp(np.arange(len(x)), np.flatnonzero(~gone), x[~gone])
    for start, stop in ranges_of(gone):
        if stop - start > LONGEST_SCATTERED:
            out[start:stop] = np.nan
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
