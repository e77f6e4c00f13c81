"""Motion that is faster than the samples: its share of every move's integral cannot be known (eq. 8.2a).

A jolt on the table lasts a millisecond. What lies near the sampling frequency folds onto zero frequency and is read as
velocity or angle. It cannot be seen, but it can be extrapolated: by a power law in frequency, from the band around a
quarter of the sampling frequency over that around half of it (the last that is seen) to the sampling frequency itself.
"""

from __future__ import annotations

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray

_AT_HALF = [1.0 / 16.0, -4.0 / 16.0, 6.0 / 16.0, -4.0 / 16.0, 1.0 / 16.0]
"""Unit gain at half the sampling frequency, fourth-order zero at rest: smooth motion does not pass."""
_AT_QUARTER = [-0.25, 0.0, 0.5, 0.0, -0.25]
MARGIN = 3.0
"""Standard deviations of the noise's own power that are not yet motion."""


def unresolved_variance(
    readings: FloatArray, move_ranges: tuple[tuple[int, int], ...], hold_ranges: list[tuple[int, int]], step_s: float
) -> FloatArray:
    """Variance of every move's integral by motion above half the sampling frequency.

    Parameters
    ----------
    readings : (n, 3)
        Raw readings of one sensor.
    move_ranges, hold_ranges : half-open sample ranges
        The holds give the power of the noise in both bands (their median), which is taken off.
    step_s : float
        Sample step, s.

    Returns
    -------
    (moves, 3) array, (raw unit · s)²
    """
    moves = np.array(move_ranges, dtype=np.int64).reshape(-1, 2)
    holds = np.array([(a, b) for a, b in hold_ranges if b - a > 8], dtype=np.int64).reshape(-1, 2)
    n_moves, n_holds = ((ranges[:, 1] - ranges[:, 0] - 4)[:, None] for ranges in (moves, holds))
    n_moves = np.maximum(n_moves, 0)

    def excess(taps: list[float]) -> FloatArray:
        power = _core.band_power(readings, taps, np.concatenate([holds, moves]))
        level = np.median(power[: len(holds)] / n_holds, axis=0) if len(holds) else np.zeros(3)
        # Neighbouring outputs of five taps share samples: about a third as many independent squares.
        usual = level * (1.0 + MARGIN * np.sqrt(6.0 / np.maximum(n_moves, 1)))
        out: FloatArray = np.maximum(power[len(holds) :] - usual * n_moves, 0.0)
        return out

    at_half, at_quarter = excess(_AT_HALF), excess(_AT_QUARTER)
    # The fall from band to band is the sensor's filter and the hand's manner: that of the usual move, not the wildest.
    total = at_quarter.sum(axis=1)
    falls = at_half.sum(axis=1)[total > 0] / total[total > 0]
    fall = min(float(np.median(falls)), 1.0) if len(falls) else 1.0
    variance: FloatArray = at_half * fall * step_s**2
    return variance
