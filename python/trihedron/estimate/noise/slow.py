"""Bias instability and rate random walk of a session from the means of its poses.

A pose of seconds shows neither; the means of some tens of poses over minutes do. Per axis, with a free constant, the
biases y of poses at t with lengths T have the covariance

    V = σ² + s² I + K² V_K + B² V_B,   V_K = min(t, t') - δ T/6,   V_B = -L/π

where σ² are the variances of the means by white noise, s is the bias repeatability from pose to pose, free because
single poses may be disturbed, and L the mean of ln|t - t'| over both windows, by its second integral
x²/2 ln|x| - 3x²/4 (1/f noise of two-sided density B²/2πf has no variance, only the variogram (2B²/π) ln; constants are
absorbed by the free mean). A pose shows one component of an accelerometer's bias, along gravity. With ``u`` (n, 3) the
directions of gravity the norm residuals have

    V = σ² + s² I + (u uᵀ) ∘ (B² V_B + K² V_K)

The likelihood is restricted to contrasts that the calibration does not absorb, and tabulated over B, K, common to the
axes, and s. docs/noise.md, section 8.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, FloatArray
from trihedron.channel_facts.low_pass import RISE
from trihedron.probability import chdtrc, chdtri
from trihedron.records.pose_noise import Measured, OctaveNoise, PoseNoise, Ratio

FEWEST_CONTRASTS = 11
"""Fewest contrasts for a comparison: with eleven a variance is uncertain by a factor of 1.5, its root by 1.25."""
SPACING = 1.3
"""Ratio of neighbouring levels of B and of K: half of the width of an interval from 30 poses."""
LOWEST, HIGHEST = 0.03, 8.0
"""Range of the levels relative to the biases' spread: a tenth of it is not detectable, three times it is excluded."""
LEAST_SIDE = 0.02
"""Smallest spread of one session's biases relative to the other's: a simulation without noise has none, and a smaller
value gives no more information."""
MIDDLE_OF_WALK = 6.0
"""The mean square of a random walk about its mean over a span is K² span/6."""
INTERVAL = np.array([0.025, 0.5, 0.975])
"""Ends of a 95 % interval and the median between."""


@dataclass(frozen=True, eq=False)
class PoseBiases:
    """Biases of one axis (n,), their standard errors by white noise (n,), middles and lengths of the poses [s] (n,).

    With unit verticals ``up`` (n, 3) in the body frame, values are gravity errors in static poses of any calibration.
    """

    values: FloatArray
    sigma: FloatArray
    time_s: FloatArray
    length_s: FloatArray
    up: FloatArray | None = None

    @property
    def basis(self) -> FloatArray:
        """(n, m) contrasts independent of the calibration: of a gyro's constant; of an accelerometer's S and b."""
        if self.up is None:
            return np.linalg.qr(np.ones((len(self.values), 1)), mode="complete")[0][:, 1:]
        x, y, z = self.up.T
        design = np.column_stack([x, y, z, x * x, y * y, z * z, x * y, x * z, y * z])
        u, size, _ = np.linalg.svd(design)
        return u[:, int((size > 1e-6 * size[0]).sum()) :]

    @property
    def span_s(self) -> float:
        """Time from the first pose to the last [s]."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def spread(self) -> float:
        """Root mean square about the mean, at least the white noise's."""
        return max(float(np.std(self.values)), float(np.median(self.sigma)))


@dataclass(frozen=True, eq=False)
class SlowDifference:
    """Slow noise of two sessions: p-value of the difference, and the ``term`` that differs most.

    ``first``, ``second``: B and K of either session, of each axis or of all together; ``ratio``: first over second.
    """

    p_value: float
    term: Literal["B", "K"]
    first: tuple[dict[str, Measured], ...]
    second: tuple[dict[str, Measured], ...]
    ratio: tuple[dict[str, Ratio], ...]


def compare_slow(first: Sequence[PoseBiases], second: Sequence[PoseBiases]) -> SlowDifference | None:
    """Bias instability and rate random walk of two sessions; ``None`` where one has too few poses.

    Twice the gain in log-likelihood of separate B and K per session over common ones (one B and one K for all axes of
    norm residuals) is tested by χ² with two degrees of freedom per entry; the term whose separate values alone gain
    more is reported.
    """
    if min(z.basis.shape[1] for z in (*first, *second)) < FEWEST_CONTRASTS:
        return None
    won, by_b, by_k = 0.0, 0.0, 0.0
    found: list[tuple[_Strengths, _Strengths]] = []
    for one, other in zip(first, second, strict=True):
        sides = tuple(replace(z, values=z.basis @ (z.basis.T @ z.values)) for z in (one, other))
        least = LEAST_SIDE * max(z.spread for z in sides)
        b = _levels([max(z.spread, least) for z in sides])
        k = _levels([max(z.spread, least) / math.sqrt(z.span_s / MIDDLE_OF_WALK) for z in sides])
        pair = tuple(_Strengths(b, k, _log_likelihood(z, b, k, least)) for z in sides)
        p, q = (side.table.max(axis=2) for side in pair)
        together = float((p + q).max())
        won += float(p.max() + q.max()) - together
        # B separate and K common; then K separate and B common.
        by_b += float((p.max(axis=0) + q.max(axis=0)).max()) - together
        by_k += float((p.max(axis=1) + q.max(axis=1)).max()) - together
        found.append((pair[0], pair[1]))
    p_value = chdtrc(2.0 * len(first), 2.0 * won)
    terms = [tuple({name: side[j].measured(name) for name in ("B", "K")} for side in found) for j in (0, 1)]
    ratios = tuple({name: one.over(other, name) for name in ("B", "K")} for one, other in found)
    return SlowDifference(p_value, "B" if by_b > by_k else "K", terms[0], terms[1], ratios)


def _levels(sizes: Sequence[float]) -> FloatArray:
    """Strengths to be tried, zero first, from the ``sizes`` of strength that would give the spread of the biases."""
    low, high = LOWEST * min(sizes), HIGHEST * max(sizes)
    n = math.ceil(math.log(high / low) / math.log(SPACING)) + 1
    return np.concatenate([[0.0], np.geomspace(low, high, n)])


def _log_likelihood(one: PoseBiases, b: FloatArray, k: FloatArray, least: float) -> FloatArray:
    """(b, k, s) restricted log-likelihood of strengths common to all axes, and of scatters from 0 to 1.5 of the spread.

    ``LOWEST`` times ``least`` is added to the white noise in squares.
    """
    basis, m = one.basis, one.basis.shape[1]
    gram = 1.0 if one.up is None else one.up @ one.up.T
    of_b, of_k = (basis.T @ (gram * kernel) @ basis for kernel in _kernels(one))
    white = basis.T @ np.diag(one.sigma**2 + (LOWEST * least) ** 2) @ basis
    s = np.concatenate([[0.0], np.geomspace(0.15, 1.5, 5) * one.spread])
    rest = (k**2)[:, None, None, None] * of_k + white + (s**2)[:, None, None] * np.eye(m)
    contrasts, out = basis.T @ one.values, []
    for strength in b:
        half = np.linalg.cholesky(rest + strength**2 * of_b)
        left = np.linalg.solve(half, np.broadcast_to(contrasts[:, None], (*half.shape[:-1], 1)))[..., 0]
        out.append(-np.log(np.einsum("...ii->...i", half)).sum(axis=-1) - 0.5 * (left**2).sum(axis=-1))
    return np.array(out)


@dataclass(frozen=True, eq=False)
class _Strengths:
    """Levels of B and of K, zero first, with the ``table`` (b, k, s) of the log-likelihood."""

    B: FloatArray
    K: FloatArray
    table: FloatArray

    def rise(self, name: str) -> FloatArray:
        """Rise of the deviance at every level of a term, the other strengths refitted."""
        return np.asarray(2.0 * (self.table.max() - self.table.max(axis=(1, 2) if name == "B" else (0, 2))))

    def quantiles(self, name: str, places: FloatArray) -> FloatArray:
        """(k,) quantiles of a term by the weight exp(-rise/2) of its sizes."""
        levels, weight = getattr(self, name), np.exp(-0.5 * self.rise(name))
        reached = np.r_[0.0, np.cumsum(0.5 * (weight[1:] + weight[:-1]) * np.diff(levels))]
        return np.asarray(np.interp(places * reached[-1], reached, levels))

    def measured(self, name: str) -> Measured:
        """Median of the weights and 95 % interval of a term, which starts at zero where it may be absent."""
        levels, root = getattr(self, name), np.sqrt(self.rise(name))
        best, end = int(root.argmin()), math.sqrt(RISE)
        high = float(np.interp(end, np.maximum.accumulate(root[best:]), levels[best:]))
        low = float(np.interp(-end, -np.maximum.accumulate(root[best::-1])[::-1], levels[: best + 1]))
        (middle,) = self.quantiles(name, np.array([0.5])).tolist()
        return Measured(middle, low, high, math.log(high / max(low, LOWEST * high)) / 3.92)

    def over(self, other: _Strengths, name: str) -> Ratio:
        """The ratio of a term to that of another session, from all pairs of quantiles of both."""
        logs = [np.log(one.quantiles(name, (np.arange(200) + 0.5) / 200)) for one in (self, other)]
        low, middle, high = np.exp(np.quantile(np.subtract.outer(*logs), INTERVAL)).tolist()
        return Ratio(middle, low, high, 1.0)


def _kernels(biases: PoseBiases) -> tuple[FloatArray, FloatArray]:
    """(n, n) covariances of the pose means per B² and per K², up to a free constant."""
    t, length = biases.time_s - biases.time_s[0], biases.length_s
    begin, end = t - length / 2.0, t + length / 2.0
    mean_log = (
        _twice_integrated(np.subtract.outer(end, begin)) - _twice_integrated(np.subtract.outer(end, end))
        - _twice_integrated(np.subtract.outer(begin, begin)) + _twice_integrated(np.subtract.outer(begin, end))
    ) / np.multiply.outer(length, length)  # fmt: skip
    walk = np.minimum.outer(t, t) + 0.5 * float(length[0]) - np.diag(length / 6.0)
    return -mean_log / math.pi, walk


def _twice_integrated(x: FloatArray) -> FloatArray:
    """The second integral of ln|x|: x²/2 ln|x| - 3x²/4."""
    size = np.maximum(np.abs(x), TINY)
    return size**2 * (0.5 * np.log(size) - 0.75)


# Correlation time of a sensor's noise: a first-order Gauss-Markov process, from the octaves inside its poses,
#     S(f) = N² + q / (1 + (2πfτ)²)                                                           (docs/noise.md, eq. N.1)
# with one τ for the axes of a sensor, N and q per axis. It is stated only where the corner explains the octaves better
# than any power of frequency (1/f, random walk), and where it lies within their range.


TIMES_PER_OCTAVE = 8
BEYOND_OCTAVES = 4.0
"""Corners are tried up to this factor outside the octaves: an interval that reaches there is not within them."""
SLOPES = np.linspace(0.5, 2.0, 7)
"""Powers of 1/f of the alternatives: from a shallow slope over 1/f to a random walk."""
BETTER = 6.63
"""Least reduction of χ² against the best slope: 1 % for one degree of freedom."""
FLOOR = 0.5
"""Least share of the white floor in the uppermost octave: a low-pass filter has a corner too, but no floor above it."""
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
    misfit = np.array([sum(t.fitted(t.corner(one))[0] for t in tables) for one in tau])
    rival = min(sum(t.fitted(t.slope(power))[0] for t in tables) for power in SLOPES)
    dof = sum(len(t.low) - 2 for t in tables) - 1
    best = int(np.argmin(misfit))
    # Where no corner explains the octaves the interval is widened (Birge ratio).
    scale = max(float(misfit[best]) / max(dof, 1), 1.0)
    inside = np.flatnonzero(misfit < misfit[best] + chdtri(1.0, 0.05) * scale)
    if rival - float(misfit[best]) < BETTER * scale or inside[0] == 0 or inside[-1] == n - 1:
        return None
    if min(t.fitted(t.corner(float(tau[best])))[1] / t.density[-1] for t in tables) < FLOOR:
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

    def fitted(self, shape: FloatArray) -> tuple[float, float, float]:
        """Deviance above that of a density in every octave, and the most likely floor and size of ``shape`` (m,)."""
        m, count = len(shape), 2.0 / self.sigma**2
        basis = np.vstack([np.ones(m), shape])
        fit = _core.SpectralBins(count, self.density, np.zeros((0, m)), np.zeros((0, 0, m)), basis).fit((0, 1))
        floor, size = fit.strength
        return fit.deviance - float(count @ (np.log(self.density) + 1.0)), floor, size
