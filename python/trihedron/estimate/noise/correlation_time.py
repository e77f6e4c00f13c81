"""Correlation time of a sensor's noise: a first-order Gauss-Markov process, from the octaves inside its poses.

    S(f) = N² + q / (1 + (2πfτ)²)                                                             (docs/noise.md, eq. N.1)

with one τ for the axes of a sensor, N and q per axis. It is stated only where the corner explains the octaves better
than any power of frequency (1/f, random walk), and where it lies within their range.
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import nnls

from trihedron.arrays import FloatArray
from trihedron.probability import chdtri
from trihedron.records.pose_noise import Measured, OctaveNoise, PoseNoise

TIMES_PER_OCTAVE = 8
BEYOND_OCTAVES = 4.0
"""Corners are tried up to this factor outside the octaves: an interval that reaches there is not within them."""
SLOPES = np.linspace(0.5, 2.0, 7)
"""Powers of 1/f of the alternatives: from a shallow slope over 1/f to a random walk."""
BETTER = 6.63
"""Least reduction of χ² against the best slope: 1 % for one degree of freedom."""
FLOOR = 0.5
"""Least share of the white floor in the uppermost octave: a low-pass filter has a corner too, but no floor above it."""
SMALLEST = 1e-6
"""Smallest prediction, relative to the density, whose logarithm is taken."""
TURNS = 4
"""Iterations of the weights: from the third on no used digit changes."""
FEWEST_OCTAVES = 5
"""Fewest octaves that can show a floor, a slope and a plateau."""


def correlation_time(axes: Sequence[PoseNoise]) -> Measured | None:
    """τ [s] of a sensor's axes with its 95 % interval; ``None`` where none is detected."""
    tables = [Octaves(axis.octaves) for axis in axes if axis.white is not None and len(axis.octaves) >= FEWEST_OCTAVES]
    if not tables:
        return None
    lowest, highest = min(t.low[0] for t in tables), max(t.high[-1] for t in tables)
    ends = 1.0 / (2.0 * math.pi * highest * BEYOND_OCTAVES), BEYOND_OCTAVES / (2.0 * math.pi * lowest)
    n = math.ceil(math.log2(ends[1] / ends[0]) * TIMES_PER_OCTAVE)
    tau = np.geomspace(*ends, n)
    misfit = np.array([sum(t.misfit(t.corner(one)) for t in tables) for one in tau])
    rival = min(sum(t.misfit(t.slope(power)) for t in tables) for power in SLOPES)
    dof = sum(len(t.low) - 2 for t in tables) - 1
    best = int(np.argmin(misfit))
    # Where no corner explains the octaves the interval is widened (Birge ratio).
    scale = max(float(misfit[best]) / max(dof, 1), 1.0)
    inside = np.flatnonzero(misfit < misfit[best] + chdtri(1.0, 0.05) * scale)
    if rival - float(misfit[best]) < BETTER * scale or inside[0] == 0 or inside[-1] == n - 1:
        return None
    if min(t.best(t.corner(float(tau[best])))[0] / t.density[-1] for t in tables) < FLOOR:
        return None
    lower, upper = float(tau[inside[0] - 1]), float(tau[inside[-1] + 1])
    return Measured(float(tau[best]), lower, upper, math.log(upper / lower) / 3.92)


class Octaves:
    """Edges (m,) [Hz], densities (m,) and the standard errors of their logarithms (m,) of one axis."""

    def __init__(self, octaves: Sequence[OctaveNoise]) -> None:
        self.low = np.array([o.low_hz for o in octaves])
        self.high = np.array([o.high_hz for o in octaves])
        self.density = np.array([o.density.value for o in octaves])
        self.sigma = np.array([o.density.sigma_log for o in octaves])

    def corner(self, tau: float) -> FloatArray:
        """(m,) mean over each octave of 1/(1 + (2πfτ)²)."""
        a, b = 2.0 * math.pi * tau * self.low, 2.0 * math.pi * tau * self.high
        return np.asarray((np.arctan(b) - np.arctan(a)) / (b - a))

    def slope(self, power: float) -> FloatArray:
        """(m,) mean over each octave of f^-power."""
        if power == 1.0:
            return np.asarray(np.log(self.high / self.low) / (self.high - self.low))
        p = 1.0 - power
        return np.asarray((self.high**p - self.low**p) / p / (self.high - self.low))

    def misfit(self, shape: FloatArray) -> float:
        """χ² of the logarithms for the best floor and size of ``shape`` (m,)."""
        floor, size = self.best(shape)
        predicted = np.maximum(floor + size * shape, SMALLEST * self.density)
        away = np.log(self.density / predicted) / self.sigma
        return float(away @ away)

    def best(self, shape: FloatArray) -> tuple[float, float]:
        """Floor and size of ``shape``, both non-negative, by least squares of relative errors."""
        predicted, found = self.density, np.zeros(2)
        for _ in range(TURNS):
            weight = 1.0 / (self.sigma * predicted)
            A = np.column_stack([np.ones_like(shape), shape]) * weight[:, None]
            y = self.density * weight
            found, _ = nnls(A, y)
            predicted = np.maximum(found[0] + found[1] * shape, SMALLEST * self.density)
        return float(found[0]), float(found[1])
