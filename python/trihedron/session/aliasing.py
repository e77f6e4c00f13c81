"""Motion that is faster than the samples: its share of every move's integral cannot be known (eq. 8.2a).

A jolt on the table lasts a millisecond. What lies near the sampling frequency folds onto zero frequency and is read as
velocity or angle. It cannot be seen, but it can be extrapolated: by a power law in frequency, from the band around a
quarter of the sampling frequency over that around half of it (the last that is seen) to the sampling frequency itself.
"""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray

_AT_HALF = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / 16.0
"""Unit gain at half the sampling frequency, fourth-order zero at rest: smooth motion does not pass."""
_AT_QUARTER = np.array([-1.0, 0.0, 2.0, 0.0, -1.0]) / 4.0
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
    half, quarter = (_power(readings, taps) for taps in (_AT_HALF, _AT_QUARTER))

    def excess(power: FloatArray) -> FloatArray:
        noise = np.array([power[a + 2 : b - 2].mean(axis=0) for a, b in hold_ranges if b - a > 8])
        level = np.median(noise, axis=0) if len(noise) else np.zeros(3)
        out = np.zeros((len(move_ranges), 3))
        for m, (a, b) in enumerate(move_ranges):
            inner = power[a + 2 : b - 2]
            if len(inner):
                # Neighbouring outputs of five taps share samples: about a third as many independent squares.
                usual = level * (1.0 + MARGIN * np.sqrt(6.0 / len(inner)))
                out[m] = np.maximum(inner.sum(axis=0) - usual * len(inner), 0.0)
        return out

    at_half, at_quarter = excess(half), excess(quarter)
    # The fall from band to band is the sensor's filter and the hand's manner: that of the usual move, not the wildest.
    total = at_quarter.sum(axis=1)
    falls = at_half.sum(axis=1)[total > 0] / total[total > 0]
    fall = min(float(np.median(falls)), 1.0) if len(falls) else 1.0
    variance: FloatArray = at_half * fall * step_s**2
    return variance


def _power(readings: FloatArray, taps: FloatArray) -> FloatArray:
    """(n, 3) squared output of a five-tap filter, scaled so that white noise gives its variance."""
    n = len(readings)
    out = np.zeros_like(readings)
    if n >= 5:
        filtered = sum(tap * readings[k : n - 4 + k] for k, tap in enumerate(taps))
        out[2 : n - 2] = np.asarray(filtered) ** 2 / (taps**2).sum()
    return np.nan_to_num(out)
