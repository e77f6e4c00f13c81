"""Noise terms from an Allan curve alone, published or stored, without its log.

Moments in the manner of the generalised method of wavelet moments (S. Guerrier et al., "Wavelet-variance-based
estimation for composite stochastic processes", JASA 108 (2013)): the logarithms of the curve's points are fitted by
generalised least squares with the covariance that the terms imply (below).

Covariance of the overlapping Allan variances of one log at several averaging times, for any mixture of terms.

Two points of a curve share their readings. With ``z_i(k)`` the second difference of the phase over ``m_i`` readings,
``γ_ij(d)`` the covariance of ``z_i(k)`` and ``z_j(k+d)`` and ``μ_i`` the mean of ``z_i`` (due to the ramp),

    cov(V_i, V_j) = Σ_k Σ_l [2 γ_ij(l-k)² + 4 μ_i μ_j γ_ij(l-k)] / (4 τ_i² τ_j² M_i M_j)        (docs/noise.md, eq. 14)

for Gaussian noise. γ is a sum over the terms present, so that the covariance is a quadratic form in their squares and
is tabulated once. The phase's generalised autocovariances are those of Greenhall and Riley (2003).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.estimate.noise.binned import EVIDENCE
from trihedron.probability import NORMAL_95
from trihedron.records.noise import TermName, allan_of_unit_terms

_DIFFERENCE = ((0, 1.0), (1, -2.0), (2, 1.0))
_GRID_RATIO = 1.12
"""Ratio of consecutive distances of the nodes from a kink of the covariance: sums are accurate to 1 %."""
_REACH = 40
"""Largest lag, in longer clusters: beyond it the squared covariance of flicker is below 1e-6 of its maximum."""


def _phase(t: FloatArray) -> FloatArray:
    """Generalised autocovariance (3, ...) of the phase for N = 1, B = 1, K = 1 at lags ``t`` [s]."""
    a = np.abs(t)
    return np.stack([-0.5 * a, a**2 * np.log(np.where(a > 0, a, 1.0)) / (2.0 * np.pi), a**3 / 12.0])


@dataclass(frozen=True, eq=False)
class CurveCovariance:
    """Covariance per product of squares, ``pairs`` (4, 4, k, k) of Q, N, B, K and ``with_ramp`` (4, k, k) of R."""

    pairs: FloatArray
    with_ramp: FloatArray

    def from_point(self, first: int) -> CurveCovariance:
        """The table without the first ``first`` points."""
        return CurveCovariance(self.pairs[:, :, first:, first:], self.with_ramp[:, first:, first:])

    def at(self, squares: FloatArray) -> FloatArray:
        """(k, k) covariance for ``squares`` (5,) of Q, N, B, K, R."""
        random = squares[:4]
        both = np.tensordot(np.outer(random, random), self.pairs, axes=2)
        return np.asarray(both + squares[4] * np.tensordot(random, self.with_ramp, axes=1))


def _pair(m_i: int, m_j: int, n: int, step_s: float) -> tuple[FloatArray, FloatArray]:
    """(4, 4) and (4,) sums for one pair of cluster sizes, ``m_i ≤ m_j``."""
    kinks = np.array([a * m_i - b * m_j for a, _ in _DIFFERENCE for b, _ in _DIFFERENCE])
    signs = np.array([x * y for _, x in _DIFFERENCE for _, y in _DIFFERENCE])
    terms_i, terms_j = n - 2 * m_i + 1, n - 2 * m_j + 1
    lag, weight = _nodes(kinks, max(1 - terms_i, -_REACH * m_j), min(terms_j - 1, _REACH * m_j))
    count = np.maximum(np.minimum(terms_i, terms_j - lag) - np.maximum(0, -lag), 0) * weight
    smooth = np.einsum("k,tkl->tl", signs, _phase((lag - kinks[:, np.newaxis]) * step_s))
    inside = (lag > kinks.min()) & (lag < kinks.max())
    # Beyond this range white noise and walk are exactly uncorrelated: rounding errors are removed.
    smooth[[0, 2]] *= inside
    white_phase = np.array([float(signs[kinks == at].sum()) for at in np.unique(kinks)])
    at_kinks = np.searchsorted(lag, np.unique(kinks))
    within = (np.unique(kinks) >= lag[0]) & (np.unique(kinks) <= lag[-1])
    white_phase, at_kinks = white_phase[within], at_kinks[within]
    # Quantisation contributes at single lags (the kinks), without the nodes' weights.
    single = count[at_kinks] / weight[at_kinks]
    pairs = np.zeros((4, 4))
    pairs[1:, 1:] = 2.0 * (smooth * count) @ smooth.T
    pairs[0, 1:] = pairs[1:, 0] = 2.0 * smooth[:, at_kinks] @ (single * white_phase)
    pairs[0, 0] = 2.0 * float(single @ white_phase**2)
    mean = (m_i * step_s) ** 2 * (m_j * step_s) ** 2
    with_ramp = 4.0 * mean * np.array([float(single @ white_phase), *(smooth @ count)])
    scale = 4.0 * (m_i * step_s) ** 2 * (m_j * step_s) ** 2 * terms_i * terms_j
    return pairs / scale, with_ramp / scale


def _nodes(kinks: IntArray, first: int, last: int) -> tuple[IntArray, FloatArray]:
    """Lags at which the sums are evaluated, dense at every kink, and the number of lags that each represents."""
    reach = max(last - first, 2)
    away = np.unique(np.round(_GRID_RATIO ** np.arange(int(np.log(reach) / np.log(_GRID_RATIO)) + 2)).astype(np.int64))
    away = np.concatenate([-away[::-1], [0], away])
    lag = np.unique(np.concatenate([(kinks[:, np.newaxis] + away).ravel(), [first, last]]))
    lag = lag[(lag >= first) & (lag <= last)]
    gap = np.diff(lag).astype(np.float64)
    weight = 0.5 * (np.concatenate([gap, [1.0]]) + np.concatenate([[1.0], gap]))
    return lag, weight


TERMS = tuple(TermName)
_RAMP = TERMS.index(TermName.RATE_RAMP)
_RISE_95 = 3.841
_RISE_95_ONE_SIDED = 2.706
_CONVERGED = 3e-4
"""Step of a log square at convergence: a tenth of the standard error from a curve of millions of readings."""
LEAST_EDF = 1.5
"""Fewest degrees of freedom of a point: with fewer it adds nothing to its neighbours."""


@dataclass(frozen=True, eq=False)
class CurveFit:
    """Squares (5,) of the terms, 0 where absent; deviance; ``covariance`` of the log squares of the free terms."""

    active: tuple[int, ...]
    squares: FloatArray
    deviance: float
    covariance: FloatArray


@dataclass(frozen=True, eq=False)
class CurvePoints:
    """Points of a curve: ``clusters`` (k,) in readings, Allan ``variance`` (k,), and the table of their covariance.

    ``tolerance`` is an additional relative standard deviation of a point, for residual low-pass filtering.
    """

    clusters: FloatArray
    variance: FloatArray
    rate_hz: float
    covariance: CurveCovariance
    tolerance: float = 0.0

    @classmethod
    def of(cls, clusters: FloatArray, variance: FloatArray, n: int, rate_hz: float) -> CurvePoints:
        """Points with the covariance table of their cluster sizes."""
        return cls(clusters, variance, rate_hz, tabulated(tuple(int(m) for m in clusters), n, rate_hz))

    @cached_property
    def tau_s(self) -> FloatArray:
        """(k,) averaging times, s."""
        return np.asarray(self.clusters / self.rate_hz)

    @cached_property
    def design(self) -> FloatArray:
        """(k, 5) Allan variance of unit terms."""
        return np.stack(list(allan_of_unit_terms(self.tau_s).values()), axis=1)

    def from_point(self, first: int, tolerance: float) -> CurvePoints:
        """The points without the first ``first``, with this ``tolerance``."""
        return CurvePoints(
            self.clusters[first:], self.variance[first:], self.rate_hz, self.covariance.from_point(first), tolerance
        )

    def residuals(self, squares: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(k,) logarithms of the points over the model's, and their (k, k) covariance.

        The logarithm of a chi-square over its ν degrees of freedom has the mean ψ(ν/2) - ln(ν/2), the variance ψ'(ν/2).
        """
        # Imported here: commands that read a log start faster.
        from scipy.special import digamma, polygamma

        mean = self.design @ squares
        relative = self.covariance.at(squares) / np.outer(mean, mean)
        variance = np.diag(relative)
        half = 1.0 / np.maximum(variance, 1e-12)
        residual = np.log(self.variance / mean) - (digamma(half) - np.log(half))
        scale = np.sqrt(polygamma(1, half) / variance)
        covariance = relative * np.outer(scale, scale)
        covariance[np.diag_indices_from(covariance)] *= 1.0 + 1e-6
        covariance[np.diag_indices_from(covariance)] += (2.0 * self.tolerance) ** 2
        return residual, covariance

    def fit(self, active: Sequence[int], start: FloatArray, held: tuple[int, float] | None = None) -> CurveFit:
        """Least deviance over the squares of ``active``, from ``start`` (5,); ``held`` fixes one of them."""
        free = [k for k in active if held is None or k != held[0]]
        squares = np.zeros(len(TERMS))
        squares[list(active)] = np.maximum(start[list(active)], 1e-6 * self.alone()[list(active)])
        if held is not None:
            squares[held[0]] = held[1]
        information = np.zeros((len(free), len(free)))
        for _ in range(30):
            residual, covariance = self.residuals(squares)
            if not free:
                break
            share = self.design[:, free] * squares[free] / (self.design @ squares)[:, np.newaxis]
            whitened = np.linalg.solve(covariance, share)
            information = share.T @ whitened
            damped = information + 1e-9 * np.eye(len(free)) * max(1e-12, float(np.trace(information)))
            step = np.clip(np.linalg.solve(damped, whitened.T @ residual), -1.5, 1.5)
            squares[free] *= np.exp(step)
            squares[free] = np.maximum(squares[free], 1e-12 * self.alone()[free])
            if np.max(np.abs(step)) < _CONVERGED:
                break
        residual, covariance = self.residuals(squares)
        _, log_determinant = np.linalg.slogdet(covariance)
        deviance = float(residual @ np.linalg.solve(covariance, residual) + log_determinant)
        return CurveFit(tuple(active), squares, deviance, np.asarray(np.linalg.pinv(information)))

    def misfit(self, squares: FloatArray) -> tuple[float, FloatArray]:
        """χ² of the points about the model, and their deviations (k,) in sigmas."""
        residual, covariance = self.residuals(squares)
        chi2 = float(residual @ np.linalg.solve(covariance, residual))
        return chi2, np.asarray(residual / np.sqrt(np.diag(covariance)))

    def alone(self) -> FloatArray:
        """(5,) largest square of each term: alone it would equal the curve at one point."""
        return np.asarray(np.min(self.variance[:, np.newaxis] / self.design, axis=0))

    def select(self) -> tuple[CurveFit, FloatArray]:
        """The subset of least deviance plus :data:`EVIDENCE` per term, and the reduction (5,) by each term."""
        fits: dict[tuple[int, ...], CurveFit] = {}
        largest = min(len(TERMS), len(self.clusters) - 1)
        for size in range(1, largest + 1):
            for active in combinations(range(len(TERMS)), size):
                if active == (_RAMP,):  # a ramp alone has no scatter, which every log has
                    continue
                fits[active] = self.fit(active, self.alone())
        best = min(fits.values(), key=lambda fit: fit.deviance + EVIDENCE * len(fit.active))
        earned = np.zeros(len(TERMS))
        for k in range(len(TERMS)):
            without, with_k = tuple(i for i in best.active if i != k), tuple(sorted({*best.active, k}))
            if without not in fits:
                earned[k] = math.inf
            elif with_k in fits:
                earned[k] = max(0.0, fits[without].deviance - fits[with_k].deviance)
        return best, earned

    def interval(self, fit: CurveFit, k: int, scale: float) -> tuple[float, float]:
        """Squares between which the deviance of term ``k`` stays within the 95 % rise, times ``scale``.

        For an absent term the lower end is 0 and the upper end a one-sided limit.
        """
        active = tuple(sorted({*fit.active, k}))
        is_present = k in fit.active
        least = fit if is_present else self.fit(active, fit.squares)
        rise = scale * (_RISE_95 if is_present else _RISE_95_ONE_SIDED)
        limit = min(least.deviance, fit.deviance) + rise
        best = max(float(least.squares[k]), 1e-9 * float(self.alone()[k]))

        def excess(log_ratio: float) -> float:
            square = best * math.exp(log_ratio)
            return self.fit(active, least.squares, (k, square)).deviance - limit

        wald = 0.3
        if is_present and fit.covariance.size:
            wald = NORMAL_95 * math.sqrt(scale * float(fit.covariance[fit.active.index(k), fit.active.index(k)]))
        up = _crossing(excess, min(max(wald, 1e-4), 2.0))
        down = _crossing(excess, -min(max(wald, 1e-4), 2.0)) if is_present else -math.inf
        return best * math.exp(down), best * math.exp(up)


@lru_cache(maxsize=64)
def tabulated(clusters: tuple[int, ...], n: int, rate_hz: float) -> CurveCovariance:
    """Table for ``clusters`` (k,) readings of a log of ``n`` readings, cached: the channels of a log share it."""
    k = len(clusters)
    pairs, with_ramp = np.zeros((4, 4, k, k)), np.zeros((4, k, k))
    for i in range(k):
        for j in range(i, k):
            pairs[:, :, i, j], with_ramp[:, i, j] = _pair(clusters[i], clusters[j], n, 1.0 / rate_hz)
            pairs[:, :, j, i], with_ramp[:, j, i] = pairs[:, :, i, j], with_ramp[:, i, j]
    return CurveCovariance(pairs, with_ramp)


def _crossing(excess: Callable[[float], float], first: float) -> float:
    """Log ratio, on the side of ``first``, at which ``excess`` crosses zero; accurate to 1 %."""
    from scipy.optimize import brentq

    outside = first
    while excess(outside) < 0.0:
        outside *= 2.0
        if abs(outside) > 60.0:
            return outside
    return float(brentq(excess, 0.0, outside, xtol=0.01 * abs(first))) if excess(0.0) < 0.0 else 0.0
