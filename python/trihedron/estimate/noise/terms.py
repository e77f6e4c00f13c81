"""Contribution of each noise term to a spectral ordinate and to the Allan variance (docs/noise.md, eq. 7-10)."""

import math

import numpy as np

from trihedron.arrays import FloatArray

SYMBOLS = ("Q", "N", "B", "K")
"""Order of the terms in every basis; the ramp R is a deterministic line and has no density."""


def continuous_densities(frequency_hz: FloatArray, rate_hz: float) -> FloatArray:
    """Two-sided density (4, k) of Q, N, B, K = 1 far below the sample rate (docs/noise.md, section 3)."""
    omega = 2.0 * np.pi * frequency_hz
    return np.stack([omega**2 / rate_hz, np.ones_like(omega), 1.0 / omega, 1.0 / omega**2])


def gauss_markov_density(frequency_hz: FloatArray, step_s: float, correlation_time_s: float) -> FloatArray:
    """Two-sided density of a Gauss-Markov process of unit variance, sampled in steps of ``step_s``."""
    ratio = step_s / correlation_time_s
    decay = math.exp(-ratio)
    # 1 - 2 d cos + d² loses its digits for time constants and periods of a million steps.
    denominator = math.expm1(-ratio) ** 2 + 4.0 * decay * np.sin(np.pi * frequency_hz * step_s) ** 2
    return np.asarray(-step_s * math.expm1(-2.0 * ratio) / denominator)
