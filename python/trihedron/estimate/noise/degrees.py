"""Equivalent degrees of freedom of Allan variances by type of noise.

Source: C. A. Greenhall, W. J. Riley, "Uncertainty of stability variances based on finite differences", Proc. 35th PTTI
Meeting, 2003, pp. 267-280 (all but total); C. A. Greenhall, D. A. Howe, D. B. Percival, "Total variance, an estimator
of long-term frequency stability", IEEE Trans. UFFC 46 (1999), Table I (total).
"""

from __future__ import annotations

import math

import numpy as np

from trihedron.records.noise import AllanKind, FloatArray

QUANTISATION, WHITE, FLICKER, WALK = 2, 0, -1, -2
"""Exponents α of the rate's spectral density f^α."""

_STEPS_PER_CLUSTER = 48
"""Starts per cluster at which the autocovariance is summed; 48 give the sum over every start to within 0.2 %."""

_TOTAL = {WHITE: (1.5, 0.0), FLICKER: (1.168, 0.222), WALK: (0.927, 0.358)}


def degrees_of_freedom(n: int, m: int, alpha: int, kind: AllanKind = "overlapping") -> float:
    """Equivalent degrees of freedom of the variance of ``n`` rate readings in clusters of ``m`` (docs/noise.md, eq. 6).

    ``edf = 2 E(V)² / var(V)``; ``alpha`` is one of :data:`QUANTISATION`, :data:`WHITE`, :data:`FLICKER`, :data:`WALK`.

    Raises
    ------
    ValueError
        When ``n`` readings hold no pair of clusters of ``m``.
    """
    difference = 3 if kind == "hadamard" else 2
    span = difference + (1 if kind == "modified" else 0)
    if m < 1 or n < (2 if kind == "total" else span) * m - (1 if kind == "modified" else 0):
        raise ValueError(f"{n} readings hold no pair of clusters of {m} readings for the {kind} variance")
    if kind == "total" and alpha in _TOTAL:
        slope, offset = _TOTAL[alpha]
        # The table is for m >> 1; at the smallest clusters nothing is reflected and the overlapping value holds.
        return max(1.0, min(slope * n / m - offset, _sum_edf(n, m, alpha, 2, False, m) if m < 8 else math.inf))
    step = 1 if kind == "non-overlapping" else m
    return _sum_edf(n, m, alpha, difference, kind == "modified", step)


def _sum_edf(n: int, m: int, alpha: int, difference: int, is_modified: bool, steps: int) -> float:
    n_phase = n + 1
    reach = m * difference + (m if is_modified else 1)
    if alpha == QUANTISATION and not is_modified:
        return _white_phase_edf(1 + steps * (n_phase - reach) // m, steps, difference)
    steps = min(steps, _STEPS_PER_CLUSTER)
    n_terms = max(1, 1 + steps * (n_phase - reach) // m)
    filtering = 1 if is_modified else (m if m < 100 else None)
    lags = np.arange(0, min(n_terms, (difference + 1) * steps))
    correlation = _difference_covariance(lags / steps, filtering, alpha, difference)
    correlation = correlation / correlation[0]
    weights = np.where(lags == 0, 1.0, 2.0) * (1.0 - lags / n_terms)
    return float(max(1.0, n_terms / np.sum(weights * correlation**2)))


def _white_phase_edf(n_terms: int, steps: int, difference: int) -> float:
    # Phase readings are independent: terms correlate only where their readings coincide, whole clusters apart.
    binomial = [(-1) ** i * math.comb(2 * difference, difference + i) for i in range(difference + 1)]
    inverse = 1.0
    for lag in range(1, difference + 1):
        if lag * steps < n_terms:
            inverse += 2.0 * (1.0 - lag * steps / n_terms) * (binomial[lag] / binomial[0]) ** 2
    return max(1.0, n_terms / inverse)


_SIGN = {2: -1.0, 1: 1.0, 0: 1.0, -1: -1.0, -2: -1.0, -3: 1.0, -4: 1.0}


def _generalised_covariance(t: FloatArray, alpha: int) -> FloatArray:
    """Generalised autocovariance of noise whose phase has the spectral density ``f^(alpha-2)``, up to a factor."""
    a = np.abs(t)
    power = _SIGN[alpha] * a ** (3 - alpha)
    return np.asarray(power if alpha % 2 == 0 else power * np.log(np.where(a > 0, a, 1.0)))


def _filtered_covariance(t: FloatArray, filtering: int | None, alpha: int) -> FloatArray:
    """The same after averaging the phase; ``filtering`` None is the limit of many readings to a cluster."""
    if filtering is None:
        return _generalised_covariance(t, alpha + 2)
    h = 1.0 / filtering
    sw = _generalised_covariance
    return filtering**2 * (2.0 * sw(t, alpha) - sw(t - h, alpha) - sw(t + h, alpha))


def _difference_covariance(t: FloatArray, filtering: int | None, alpha: int, difference: int) -> FloatArray:
    out = np.zeros_like(t)
    for shift in range(-difference, difference + 1):
        weight = (-1) ** shift * math.comb(2 * difference, difference + shift)
        out += weight * _filtered_covariance(t + shift, filtering, alpha)
    return out
