"""Whether readings follow the scatter of their timestamps: motion shows it (docs/reading.md, 4)."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray, IntArray

CONTRAST = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / 6.0
"""A sample against the cubic through its four neighbours, on an even grid."""
REACH = 3
"""Samples on either side from which a slope is taken: (k x_{+k} - k x_{-k}) / 28 for k to 3."""
CLEAR_SLOPE = 3.0
"""Standard errors of a slope below which a reading tells nothing of time."""
FARTHEST = 1.5
"""Timestamps further off than this many steps: what a straight line through the motion says of them is no use."""
PART, PARTS = 1 << 17, 8
"""The most active stretches of a long log are looked at."""
BLOCK = 50
"""Rows of a block: neighbouring misfits share samples and motion."""


def followed(time_s: FloatArray, even_s: FloatArray, tick: IntArray, triads: list[FloatArray]) -> tuple[float, float]:
    """Share s of the timestamps' scatter about an even clock that the readings (n, 3) follow, and its standard error.

    A sample taken δ late reads x' δ more, and stands out from the cubic through its neighbours by the contrast of that:
    s is the slope of one against the other over all channels in motion. 1: samples were taken when timestamped; 0:
    evenly. The error is that of blocks (infinite without motion).
    """
    step_s = float((even_s[-1] - even_s[0]) / max(int(tick[-1] - tick[0]), 1))
    top = np.zeros(0)
    bottom = np.zeros(0)
    for rows in _active(triads, len(time_s)):
        t, b = _sums(time_s[rows] - even_s[rows], step_s, tick[rows], [x[rows] for x in triads])
        top, bottom = np.concatenate([top, t]), np.concatenate([bottom, b])
    total = float(bottom.sum())
    if len(bottom) < 10 or total <= 0.0:
        return 0.0, float("inf")
    share = float(top.sum()) / total
    return share, float(np.sqrt(np.sum((top - share * bottom) ** 2))) / total


def _active(triads: list[FloatArray], n: int) -> list[slice]:
    parts = [slice(a, min(a + PART, n)) for a in range(0, n, PART)]
    if len(parts) <= PARTS:
        return parts
    activity = np.zeros(len(parts))
    for x in triads:
        spread = np.array([_spread(x[p][::16]) for p in parts])
        activity += spread / max(float(np.median(spread)), 1e-300)
    return [parts[k] for k in sorted(np.argsort(activity)[::-1][:PARTS])]


def _spread(x: FloatArray) -> float:
    """Standard deviation over the rows (n, 3) without a missing reading, summed over the axes; 0 without such rows."""
    whole = x[np.isfinite(x).all(axis=1)]
    return float(whole.std(axis=0).sum()) if len(whole) else 0.0


def _sums(late: FloatArray, step_s: float, tick: IntArray, triads: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Blocks' sums of misfit times prediction and of squared prediction."""
    from scipy.ndimage import uniform_filter1d  # here: most logs have timestamps that need no such question

    n = len(late)
    margin = REACH + 2
    if n < 4 * BLOCK:
        return np.zeros(0), np.zeros(0)
    inner = np.arange(margin, n - margin)
    # Only where no sample is lost within reach.
    whole = tick[inner + margin] - tick[inner - margin] == 2 * margin
    late = (late - np.median(late)) / step_s
    near = np.abs(late) < FARTHEST
    whole &= near[inner] & near[inner - 1] & near[inner + 1] & near[inner - 2] & near[inner + 2]
    top, bottom = np.zeros(len(inner)), np.zeros(len(inner))
    for x in triads:
        for axis in range(3):
            column = x[:, axis]
            change = np.abs(np.diff(column))
            change = change[np.isfinite(change)]
            if not len(change):
                continue
            noise = float(np.median(change)) / 0.954  # of one reading: √2 · 0.6745
            noise = max(noise, float(change.max()) * 1e-6)
            if not noise > 0.0:
                continue
            y = column / noise
            slope = np.sum([k * (np.roll(y, -k) - np.roll(y, k)) for k in range(1, REACH + 1)], axis=0) / 28.0
            left = np.convolve(y, CONTRAST, mode="same")[inner]
            made = np.convolve(slope * late, CONTRAST, mode="same")[inner]
            good = whole & np.isfinite(left) & np.isfinite(made) & (np.abs(slope[inner]) > CLEAR_SLOPE / np.sqrt(28.0))
            left, made = np.where(good, left, 0.0), np.where(good, made, 0.0)
            # Quick motion bends by itself: its rows weigh by what they leave around them.
            around = uniform_filter1d(left**2, 33, mode="nearest") / np.maximum(
                uniform_filter1d(good.astype(np.float64), 33, mode="nearest"), 1.0 / 33.0
            )
            weight = good / (2.0 + around)
            top += weight * left * made
            bottom += weight * made**2
    m = len(inner) // BLOCK * BLOCK
    return top[:m].reshape(-1, BLOCK).sum(axis=1), bottom[:m].reshape(-1, BLOCK).sum(axis=1)
