"""Motion that is faster than the samples: its share of every move's integral cannot be known (eq. 8.2a).

A jolt on the table lasts a millisecond. What lies near the multiples of the sampling frequency f folds onto zero
frequency and is read as velocity or angle. It cannot be seen, but it can be extrapolated by a power law. With power
c ν^-p on either side of zero, what the samples show at f/4, at f/2 and falsely at zero are sums over all foldings,

    D₁ = c (f/4)^-p Z,   D₂ = 2 c (f/2)^-p Z,   A = 2 c f^-p Z / (1 - 2^-p),   Z = 1 + 3^-p + 5^-p + ...

so that D₁/D₂ = 2^p/2 and A = D₂/(2 D₁/D₂ - 1): all of it for what is white among the samples (D₁ = D₂), no more, and a
third of it for a rate that steps (p = 2). D₁ holds slower motion too, which makes the fall look steep: up to the third,
a part of it is believed to be of its band.
"""

from __future__ import annotations

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray

_AT_HALF = [1.0 / 16.0, -4.0 / 16.0, 6.0 / 16.0, -4.0 / 16.0, 1.0 / 16.0]
"""Unit gain at half the sampling frequency, fourth-order zero at rest: smooth motion does not pass."""
_AT_QUARTER = [-0.25, 0.0, 0.5, 0.0, -0.25]
OF_A_STEP = 1.0 / 3.0
"""Part of the power at half the sampling frequency that a rate with steps has falsely at zero: 1/(2^p - 1) of p = 2."""
OF_ITS_BAND = 0.4
"""Part of the power around a quarter of the sampling frequency that is not slower motion, where a body knocks and rocks
at a tenth of it."""
MARGIN = 3.0
"""Standard deviations of the noise's own power that are not yet motion."""


def unresolved_variance(
    readings: FloatArray,
    move_ranges: tuple[tuple[int, int], ...],
    hold_ranges: list[tuple[int, int]],
    step_s: float,
    quantum: FloatArray,
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
    quantum : (3,)
        Step of the converter, whose rounding no hold shows where the zero stays inside one step, and every move does.

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
        level = np.maximum(level, quantum**2 / 12.0)
        # Neighbouring outputs of five taps share samples: about a third as many independent squares.
        usual = level * (1.0 + MARGIN * np.sqrt(6.0 / np.maximum(n_moves, 1)))
        out: FloatArray = np.maximum(power[len(holds) :] - usual * n_moves, 0.0)
        return out

    at_half, at_quarter = excess(_AT_HALF), excess(_AT_QUARTER)
    # The fall from band to band is the sensor's filter and the hand's manner: that of the usual move, not the wildest.
    total, falls = at_quarter.sum(axis=1), at_half.sum(axis=1)
    both = (total > 0) & (falls > 0)
    fall = min(float(np.median(falls[both] / total[both])), 1.0) if np.any(both) else 1.0
    slowest = min(fall / OF_ITS_BAND, 1.0)
    part = max(fall / (2.0 - fall), min(slowest / (2.0 - slowest), OF_A_STEP))
    variance: FloatArray = at_half * part * step_s**2
    return variance
