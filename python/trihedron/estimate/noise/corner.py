"""The corner of a low-pass filter in the spectrum of a sensor at rest."""

from __future__ import annotations

import math

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.records.hold_noise import Measured

EARNED = 16.0
"""Drop of the deviance that a corner must earn: it is searched over a grid and two orders."""
RISE = 4.6
"""Rise at the ends of its 95 % interval, other terms on the edge of what can be (docs/noise.md, 3)."""
TOLERANCE = 0.03
"""No band of the spectrum is believed to better: no nearer is real noise flat, or a filter a Butterworth."""


def filter_corner(
    frequency_hz: FloatArray, power: FloatArray, count: int, rate_hz: float, rounding: float, scatter: float
) -> tuple[Measured | None, float]:
    """Corner [Hz] of a filter of first or second order, ``None`` where none shows, and what it lies above then.

    The spectrum (k,) of ``count`` segments is a filtered white one over flicker, rounding (``rounding`` is its share of
    the power from reading to reading) unfiltered beneath.
    """
    n = len(power)
    weight = np.full(n, float(count))
    # Bands of an eighth of the spectrum weigh no more than the tolerance and the scatter of holds allow.
    cap = 2.0 / (TOLERANCE**2 + scatter**2 / max(count, 1)) / (n / 8.0)
    weight = np.minimum(weight, cap)
    zero = np.zeros(n)
    flicker = 1.0 / frequency_hz
    nyquist = rate_hz / 2.0

    def deviance(corner: float, order: int) -> float:
        gain = _folded(frequency_hz, corner, order, rate_hz) if math.isfinite(corner) else np.ones(n)
        basis = np.stack([(1.0 - rounding) * gain + rounding, flicker])
        return float(_core.SpectralBins(weight, power, zero, zero, basis).fit([0, 1], False).deviance)

    if not np.any(power > 0.0):
        return None, 0.0
    flat = deviance(math.inf, 1)
    grid = np.geomspace(max(nyquist / 64.0, 4.0 * frequency_hz[0]), 4.0 * nyquist, 49)
    table = np.array([[deviance(float(c), order) for c in grid] for order in (1, 2)])
    best = table.min(axis=0)
    inside = grid[best <= min(float(best.min()), flat) + RISE]
    place = int(np.argmin(best))
    if flat - best[place] < EARNED:
        lowest = float(inside[0]) if len(inside) else nyquist
        return None, lowest
    ratio = float(grid[1] / grid[0])
    lower, upper = float(inside[0]) / math.sqrt(ratio), float(inside[-1]) * math.sqrt(ratio)
    sigma = math.log(upper / lower) / (2.0 * math.sqrt(RISE))
    return Measured(float(grid[place]), lower, upper, sigma), lower


def _folded(frequency_hz: FloatArray, corner_hz: float, order: int, rate_hz: float) -> FloatArray:
    """Gain of a Butterworth filter ahead of the sampling, what lies above Nyquist folded back; 1 at zero."""
    fold = rate_hz * np.arange(-8, 9)
    gain = np.sum(1.0 / (1.0 + ((frequency_hz[:, np.newaxis] + fold) / corner_hz) ** (2 * order)), axis=1)
    return np.asarray(gain / np.sum(1.0 / (1.0 + (fold / corner_hz) ** (2 * order))))
