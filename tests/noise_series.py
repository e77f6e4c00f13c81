"""Noise series with known terms for the tests and benches of the noise room."""

import numpy as np


def fractional(rng, n, d=0.5):
    """Noise of density |2 sin(ω/2)|^(-2d), unit innovations: 1/f for d = 1/2; the first half is thrown away."""
    k = np.arange(1, n + n)
    response = np.concatenate([[1.0], np.cumprod((k - 1 + d) / k)])
    length = 4 * n
    drive = rng.normal(size=2 * n)
    return np.fft.irfft(np.fft.rfft(drive, length) * np.fft.rfft(response, length), length)[n : 2 * n]


def series(rng, n, rate_hz, Q=0.0, N=0.0, B=0.0, K=0.0, R=0.0):
    """Rate readings (n,) holding the five terms of IEEE 952 (docs/noise.md, eq. 7)."""
    dt = 1.0 / rate_hz
    x = np.zeros(n)
    if Q:
        x += Q / dt * np.diff(rng.normal(size=n + 1))
    if N:
        x += N / np.sqrt(dt) * rng.normal(size=n)
    if B:
        x += B * fractional(rng, n)
    if K:
        x += K * np.sqrt(dt) * np.cumsum(rng.normal(size=n))
    if R:
        x += R * dt * np.arange(n)
    return x
