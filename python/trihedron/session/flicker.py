"""How far 1/f noise carries zeros from pose to pose, from what it does inside poses (docs/model-session.md, 11.12d)."""

from __future__ import annotations

import math

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray

PARTS = 8
"""Of a pose: their means differ from neighbour to neighbour by white noise, its halves by white noise and flicker."""
FEWEST_POSES = 6
FEWEST_READINGS = 4 * PARTS
MEDIAN_OF_SQUARE = 0.4549
"""Of a standard normal's square."""
FAR = 9.0
"""Squares beyond so many variances are a hand's, not the noise's."""
SEEN = 1.0
"""Standard errors of the mean square of the halves by which it must exceed white noise's, where it widens bars only."""


def expected_scatter(readings: FloatArray, spans: IntArray, up: FloatArray) -> float:
    """Standard deviation [raw] of a pose's zero about that of the session by flicker alone, along the vertical.

    Means of neighbouring parts of length t differ by a variance 2N²/t + 4 ln 2 h of white noise N² and a flicker of
    one-sided density h/f; beneath the frequencies that a pose of length T sees, down to those of a session of length L,
    lies a variance h ln(L/2T). Nothing, 0, where halves of poses differ as white noise makes them.

    Parameters
    ----------
    readings : (n, 3)
        Accelerometer, raw.
    spans : (h, 2)
        Half-open ranges of the poses.
    up : (h, 3)
        Raw unit verticals; NaN where unknown.
    """
    size = spans[:, 1] - spans[:, 0]
    usable = (size >= FEWEST_READINGS) & np.isfinite(up).all(axis=1)
    if np.count_nonzero(usable) < FEWEST_POSES:
        return 0.0
    spans, size, up = spans[usable], size[usable], up[usable]
    halves = _steps(readings, spans, up[:, None, :], 2)
    parts = _steps(readings, spans, up[:, None, :], PARTS)
    return float(_between_poses(halves, parts, spans)[0])


def expected_scatter_of_axes(readings: FloatArray, spans: IntArray) -> float:
    """The same of a gyro, rms over its axes: its bias shows along all of them."""
    spans = spans[spans[:, 1] - spans[:, 0] >= FEWEST_READINGS]
    if len(spans) < FEWEST_POSES:
        return 0.0
    axes = np.broadcast_to(np.eye(3), (len(spans), 3, 3))
    found = _between_poses(_steps(readings, spans, axes, 2), _steps(readings, spans, axes, PARTS), spans)
    return float(np.sqrt(np.mean(found**2)))


def _between_poses(halves: FloatArray, parts: FloatArray, spans: IntArray) -> FloatArray:
    """(k,) scatter along each direction from steps of halves (h, 1, k) and of parts (h, PARTS - 1, k) of poses."""
    k = halves.shape[2]
    of_halves = np.array([_mean_square(halves[:, :, i].ravel()) for i in range(k)])
    # What halves would differ by if what makes the parts differ were white.
    white = np.array([_mean_square(parts[:, :, i].ravel()) for i in range(k)]) * (2.0 / PARTS)
    if not (white > 0.0).all():
        return np.zeros(k)  # readings are missing, or never change
    excess = float(np.mean(of_halves / white)) - 1.0
    if not excess > SEEN * math.sqrt(2.0 / halves.size):
        return np.zeros(k)
    level = excess * white / (4.0 * math.log(2.0) * (1.0 - 2.0 / PARTS))
    octaves = float(np.ptp(spans)) / (2.0 * float(np.median(spans[:, 1] - spans[:, 0])))
    out: FloatArray = np.sqrt(level * max(math.log(octaves), 0.0))
    return out


def _steps(readings: FloatArray, spans: IntArray, along: FloatArray, n: int) -> FloatArray:
    """(h, n - 1, k) differences of the means of ``n`` neighbouring parts of every pose along directions (h, k, 3)."""
    edges = spans[:, :1] + (spans[:, 1:] - spans[:, :1]) * np.arange(n + 1) // n
    ranges = np.stack([edges[:, :-1], edges[:, 1:]], axis=2).reshape(-1, 2)
    means, _ = _core.means_by_owner(readings, ranges, np.arange(len(ranges)), len(ranges))
    out: FloatArray = np.diff(np.einsum("hnc,hkc->hnk", means.reshape(len(spans), n, 3), along), axis=1)
    return out


def _mean_square(x: FloatArray) -> float:
    squares = x**2
    near = squares <= FAR * np.median(squares) / MEDIAN_OF_SQUARE
    return float(np.mean(squares[near]))
