"""Rows of several devices in one stream, told by the readings: every second (third, fourth) row is another sensor's."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray

_MOST = 4
_BLOCK = 24
"""Rows of a block: a multiple of two, three and four."""
_ROWS = 48_000
_CLEAR = 6.0
"""Standard errors by which rows of one kind differ from the others, in the usual block at rest; of one sensor's white
noise 0.7, and 1.3
where its noise alternates (autocorrelation -0.5)."""
_SAME_SIGN = 0.9


def n_interleaved(readings: FloatArray) -> int:
    """How many devices take turns in rows (n, k) of readings; 1 where rows are one device's."""
    rows = readings[:_ROWS]
    blocks = len(rows) // _BLOCK
    if blocks < 8:
        return 1
    parts = rows[: blocks * _BLOCK].reshape(blocks, _BLOCK, -1)
    parts = parts[np.isfinite(parts).all(axis=(1, 2))]
    if len(parts) < 8:
        return 1
    return next((k for k in range(2, _MOST + 1) if _takes_turns(parts, k)), 1)


def _takes_turns(parts: FloatArray, k: int) -> bool:
    """Whether each k-th row of blocks (m, rows, channels) differs from the rest by far more than from its like."""
    n = parts.shape[1] // k
    noise = np.sqrt(np.mean((parts[:, k:] - parts[:, :-k]) ** 2, axis=1) / 2.0)
    change = np.abs(np.diff(parts, axis=1))
    # Readings that toggle between two LSB are one sensor's.
    step = np.where(change > 0.0, change, np.inf).min(axis=(0, 1))
    step = np.where(np.isfinite(step), step, 0.0)
    quiet = np.argsort(noise.sum(axis=1), kind="stable")[: max(len(parts) // 2, 8)]
    quiet.sort()
    classes = parts[quiet].reshape(len(quiet), n, k, -1).mean(axis=1)
    contrast = classes[:, 0] - classes[:, 1:].mean(axis=1)
    error = np.sqrt((noise[quiet] ** 2 + step**2 / 12.0) * (1.0 + 1.0 / (k - 1)) / n)
    score = np.abs(contrast) / np.where(error > 0.0, error, np.inf)
    same = np.mean(np.sign(contrast[1:]) == np.sign(contrast[:-1]), axis=0)
    far = (np.median(score, axis=0) > _CLEAR) & (np.median(np.abs(contrast), axis=0) > 2.0 * step)
    return bool(np.any(far & (same > _SAME_SIGN)))
