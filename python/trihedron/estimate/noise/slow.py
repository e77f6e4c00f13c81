"""Bias instability and rate random walk of a session from the means of its poses.

A pose of seconds shows neither; the means of some tens of poses over minutes do. Per axis, with a free constant, the
biases y of poses at t with lengths T have the covariance

    V = σ² + s² I + K² V_K + B² V_B,   V_K = min(t, t') - δ T/6,   V_B = -L/π

where σ² are the variances of the means by white noise, s is the bias repeatability from pose to pose, free because
single poses may be disturbed, and L the mean of ln|t - t'| over both windows, by its second integral
x²/2 ln|x| - 3x²/4 (1/f noise of two-sided density B²/2πf has no variance, only the variogram (2B²/π) ln; constants are
absorbed by the free mean). A pose shows one component of an accelerometer's bias, along gravity. With ``u`` (n, 3) the
directions of gravity the norm residuals have

    V = σ² + s² I + Σ_k (u_k u_kᵀ) ∘ (B_k² V_B + K_k² V_K)

The likelihood is restricted to contrasts that the calibration does not absorb; all strengths and ``s`` are integrated
jointly over a low-discrepancy sequence, because the axes are correlated. docs/noise.md, section 9.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, FloatArray
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
DRAWS = {1: 4096, 3: 8192}
"""Points over the strengths of so many axes and s: some hundred share the weight for a session of 30 poses."""
ABSENT = 0.1
"""Prior probability that a strength is zero."""
SHOWN = 0.1
"""A strength is present where the odds of its absence fall to a tenth (Jeffreys' strong evidence)."""
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

    ``first``, ``second``: B and K of either session per axis; ``ratio``: B and K per axis, first over second.
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
    more is reported. Values and ratios are per axis.
    """
    if min(z.basis.shape[1] for z in (*first, *second)) < FEWEST_CONTRASTS:
        return None
    won, by_b, by_k = 0.0, 0.0, 0.0
    drawn: list[tuple[_Drawn, _Drawn]] = []
    for one, other in zip(first, second, strict=True):
        sides = tuple(_free_of_calibration(z) for z in (one, other))
        least = LEAST_SIDE * max(z.spread for z in sides)
        b = _levels([max(z.spread, least) for z in sides])
        k = _levels([max(z.spread, least) / math.sqrt(z.span_s / MIDDLE_OF_WALK) for z in sides])
        parts = [_Parts.of(z, least) for z in sides]
        p, q = (_log_likelihood(of, b, k) for of in parts)
        together = float((p + q).max())
        won += float(p.max() + q.max()) - together
        # B separate and K common; then K separate and B common.
        by_b += float((p.max(axis=0) + q.max(axis=0)).max()) - together
        by_k += float((p.max(axis=1) + q.max(axis=1)).max()) - together
        drawn.append((_Drawn.of(parts[0], b, k), _Drawn.of(parts[1], b, k)))
    p_value = chdtrc(2.0 * len(first), 2.0 * won)
    sides_terms = [tuple(term for pair in drawn for term in pair[j].terms()) for j in (0, 1)]
    ratios = tuple(_ratios(*pair, axis) for pair in drawn for axis in range(pair[0].B.shape[1]))
    return SlowDifference(p_value, "B" if by_b > by_k else "K", sides_terms[0], sides_terms[1], ratios)


def _free_of_calibration(one: PoseBiases) -> PoseBiases:
    """The biases projected on their contrasts: the part that a calibration absorbs is removed."""
    basis = one.basis
    return replace(one, values=basis @ (basis.T @ one.values))


def _levels(sizes: Sequence[float]) -> FloatArray:
    """Strengths to be tried, zero first, from the ``sizes`` of strength that would give the spread of the biases."""
    low, high = LOWEST * min(sizes), HIGHEST * max(sizes)
    n = math.ceil(math.log(high / low) / math.log(SPACING)) + 1
    return np.concatenate([[0.0], np.geomspace(low, high, n)])


@dataclass(frozen=True, eq=False)
class _Parts:
    """Contrasts (m,), their white covariance (m, m), covariances (axes, m, m) per B² and per K², rms ``spread``."""

    contrasts: FloatArray
    white: FloatArray
    of_b: FloatArray
    of_k: FloatArray
    spread: float

    @classmethod
    def of(cls, one: PoseBiases, least: float) -> _Parts:
        """Parts of a session; ``LOWEST`` times ``least`` is added to its white noise in squares."""
        basis, up = one.basis, np.ones((len(one.values), 1)) if one.up is None else one.up
        gram = np.einsum("ik,jk->kij", up, up)
        of_b, of_k = (basis.T @ (gram * kernel) @ basis for kernel in _kernels(one))
        white = basis.T @ np.diag(one.sigma**2 + (LOWEST * least) ** 2) @ basis
        return cls(basis.T @ one.values, white, of_b, of_k, one.spread)

    def log_likelihood(self, V: FloatArray) -> FloatArray:
        """(...,) restricted log-likelihood of covariances (..., m, m) of the contrasts."""
        half = np.linalg.cholesky(V)
        left = np.linalg.solve(half, np.broadcast_to(self.contrasts[:, None], (*V.shape[:-1], 1)))[..., 0]
        log_det = 2.0 * np.log(np.einsum("...ii->...i", half)).sum(axis=-1)
        return np.asarray(-0.5 * (log_det + (left**2).sum(axis=-1)))


def _log_likelihood(parts: _Parts, b: FloatArray, k: FloatArray) -> FloatArray:
    """(b, k) log-likelihood of strengths common to all axes, at the best ``s`` for each."""
    s = np.concatenate([[0.0], np.geomspace(0.15, 1.5, 5) * parts.spread])
    scatter = (s**2)[:, None, None] * np.eye(len(parts.contrasts))
    of_k = (k**2)[:, None, None, None] * parts.of_k.sum(axis=0) + parts.white + scatter
    of_b = parts.of_b.sum(axis=0)
    return np.array([parts.log_likelihood(of_k + strength**2 * of_b).max(axis=1) for strength in b])


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Strengths (draws, axes) of B and of K with their posterior weights (draws,)."""

    B: FloatArray
    K: FloatArray
    weight: FloatArray

    @classmethod
    def of(cls, parts: _Parts, b: FloatArray, k: FloatArray) -> _Drawn:
        """Draws within the levels ``b``, ``k``: prior flat in the logarithm, with a share of the points at zero."""
        from scipy.stats import qmc  # imported here: the import takes longer than most noise analyses

        axes = len(parts.of_b)
        u = qmc.Sobol(2 * axes + 1, seed=0).random(DRAWS[axes])
        depth, there = (u - ABSENT) / (1.0 - ABSENT), u >= ABSENT
        highest = np.r_[np.full(axes, b[-1]), np.full(axes, k[-1]), HIGHEST / 4.0 * parts.spread]
        part = np.exp(-np.log(b[-1] / b[1]) * depth) * there
        B, K, s = np.split(highest * part, [axes, 2 * axes], axis=1)
        V = parts.white + np.einsum("dk,kab->dab", B**2, parts.of_b) + np.einsum("dk,kab->dab", K**2, parts.of_k)
        log_weight = parts.log_likelihood(V + (s**2)[:, :, None] * np.eye(len(parts.contrasts)))
        weight = np.exp(log_weight - log_weight.max())
        return cls(B, K, weight / weight.sum())

    def terms(self) -> tuple[dict[str, Measured], ...]:
        """B and K of every axis: median and 95 % interval, which starts at zero where the term may be absent."""
        return tuple(
            {name: _measured(of, self.weight) for name, of in (("B", b), ("K", k))}
            for b, k in zip(self.B.T, self.K.T, strict=True)
        )


def _quantiles(values: FloatArray, weight: FloatArray, places: FloatArray) -> FloatArray:
    """Weighted quantiles (k,) of ``values`` at ``places`` (k,)."""
    order = np.argsort(values)
    reached = np.cumsum(weight[order]) / max(float(weight.sum()), TINY)
    return values[order[np.minimum(np.searchsorted(reached, places), len(order) - 1)]]


def _measured(values: FloatArray, weight: FloatArray) -> Measured:
    low, middle, high = _quantiles(values, weight, INTERVAL).tolist()
    of_absent = float(weight[values == 0.0].sum())
    is_there = of_absent / max(1.0 - of_absent, TINY) < SHOWN * ABSENT / (1.0 - ABSENT)
    sigma = math.log(high / max(low, LOWEST * high)) / 3.92 if high > 0.0 else 0.0
    return Measured(middle, low if is_there else 0.0, high, sigma)


def _ratios(first: _Drawn, second: _Drawn, axis: int) -> dict[str, Ratio]:
    """Ratios first over second, from all pairs of quantiles of both posteriors."""
    out = {}
    places = (np.arange(200) + 0.5) / 200
    for name in ("B", "K"):
        logs = []
        for one in (first, second):
            values = getattr(one, name)[:, axis]
            there = values > 0.0
            logs.append(np.log(_quantiles(values[there], one.weight[there], places)))
        low, middle, high = np.exp(np.quantile(np.subtract.outer(*logs), INTERVAL))
        out[name] = Ratio(float(middle), float(low), float(high), 1.0)
    return out


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
