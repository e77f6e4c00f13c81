"""Covariance of the overlapping Allan variances of one log at several averaging times, for any mixture of terms.

Two points of a curve share their readings. With ``z_i(k)`` the second difference of the phase over ``m_i`` readings,
``γ_ij(d)`` the covariance of ``z_i(k)`` and ``z_j(k+d)`` and ``μ_i`` the mean of ``z_i`` (the ramp's),

    cov(V_i, V_j) = Σ_k Σ_l [2 γ_ij(l-k)² + 4 μ_i μ_j γ_ij(l-k)] / (4 τ_i² τ_j² M_i M_j)        (docs/noise.md, eq. 14)

for Gaussian noise. γ is a sum over the terms present, so that the covariance is a quadratic form in their squares and
is tabulated once. The phase's generalised autocovariances are those of Greenhall and Riley (2003).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray

_DIFFERENCE = ((0, 1.0), (1, -2.0), (2, 1.0))
_GRID_RATIO = 1.12
"""Lags between nodes of the sums grow by this away from every kink of the covariance: sums good to 1 %."""
_REACH = 40
"""Lags beyond this many of the longer clusters: flicker has lost all but 1e-6 of its covariance squared."""


def _wiener(t: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * np.abs(t))


def _flicker(t: FloatArray) -> FloatArray:
    a = np.abs(t)
    return np.asarray(a**2 * np.log(np.where(a > 0, a, 1.0)) / (2.0 * np.pi))


def _integrated_walk(t: FloatArray) -> FloatArray:
    return np.asarray(np.abs(t) ** 3 / 12.0)


_PHASE: tuple[Callable[[FloatArray], FloatArray], ...] = (_wiener, _flicker, _integrated_walk)
"""Generalised autocovariance of the phase for N = 1, B = 1, K = 1."""


@dataclass(frozen=True, eq=False)
class CurveCovariance:
    """Covariance per product of squares, ``pairs`` (4, 4, k, k) of Q, N, B, K and ``with_ramp`` (4, k, k) of R."""

    pairs: FloatArray
    with_ramp: FloatArray

    @classmethod
    def of(cls, clusters: npt.NDArray[np.int64], n: int, rate_hz: float) -> CurveCovariance:
        """Tabulate for ``clusters`` (k,) readings of a log of ``n`` readings."""
        k = len(clusters)
        pairs, with_ramp = np.zeros((4, 4, k, k)), np.zeros((4, k, k))
        for i in range(k):
            for j in range(i, k):
                pairs[:, :, i, j], with_ramp[:, i, j] = _pair(int(clusters[i]), int(clusters[j]), n, 1.0 / rate_hz)
                pairs[:, :, j, i], with_ramp[:, j, i] = pairs[:, :, i, j], with_ramp[:, i, j]
        return cls(pairs, with_ramp)

    def from_point(self, first: int) -> CurveCovariance:
        """The same without the first points."""
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
    smooth = np.zeros((3, len(lag)))
    distance = (lag[np.newaxis, :] - kinks[:, np.newaxis]) * step_s
    for row, phase in enumerate(_PHASE):
        smooth[row] = signs @ phase(distance)
    inside = (lag > kinks.min()) & (lag < kinks.max())
    # Beyond their support white noise and walk are uncorrelated exactly, and only rounding is left.
    smooth[[0, 2]] *= inside
    white_phase = np.array([float(signs[kinks == at].sum()) for at in np.unique(kinks)])
    at_kinks = np.searchsorted(lag, np.unique(kinks))
    within = (np.unique(kinks) >= lag[0]) & (np.unique(kinks) <= lag[-1])
    white_phase, at_kinks = white_phase[within], at_kinks[within]
    # A kink is one lag, not a stretch of the sum.
    single = count[at_kinks] / weight[at_kinks]
    pairs = np.zeros((4, 4))
    pairs[1:, 1:] = 2.0 * (smooth * count) @ smooth.T
    pairs[0, 1:] = pairs[1:, 0] = 2.0 * smooth[:, at_kinks] @ (single * white_phase)
    pairs[0, 0] = 2.0 * float(single @ white_phase**2)
    mean = (m_i * step_s) ** 2 * (m_j * step_s) ** 2
    with_ramp = 4.0 * mean * np.array([float(single @ white_phase), *(smooth @ count)])
    scale = 4.0 * (m_i * step_s) ** 2 * (m_j * step_s) ** 2 * terms_i * terms_j
    return pairs / scale, with_ramp / scale


def _nodes(kinks: npt.NDArray[np.int64], first: int, last: int) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Lags at which the sums are evaluated, dense at every kink, and the lags that each stands for."""
    reach = max(last - first, 2)
    away = np.unique(np.round(_GRID_RATIO ** np.arange(int(np.log(reach) / np.log(_GRID_RATIO)) + 2)).astype(np.int64))
    away = np.concatenate([-away[::-1], [0], away])
    lag = np.unique(np.concatenate([(kinks[:, np.newaxis] + away).ravel(), [first, last]]))
    lag = lag[(lag >= first) & (lag <= last)]
    gap = np.diff(lag).astype(np.float64)
    weight = 0.5 * (np.concatenate([gap, [1.0]]) + np.concatenate([[1.0], gap]))
    return lag, weight
