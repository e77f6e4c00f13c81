"""Quaternions (w, x, y, z), smooth strokes, noise and filters of the desk's generator."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.signal import bilinear, lfilter, lfilter_zi

Array = npt.NDArray[np.float64]
DEGREE = np.pi / 180.0
TINY = 1e-9
"""Rotation (rad) below which the series of the sine is exact."""


def stream(seed: int, name: str) -> np.random.Generator:
    """A generator of its own for every purpose, so that a flaw leaves all other draws as they are."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def minimum_jerk(x: Any) -> Array:
    """0 to 1 for x from 0 to 1; rate and acceleration vanish at both ends."""
    x = np.clip(x, 0, 1)
    return np.asarray(x**3 * (10 - 15 * x + 6 * x * x))


def there_and_back(x: Any) -> Array:
    """0, up to 1 at x = 0.5, and back."""
    return minimum_jerk(x / 0.5) * minimum_jerk((1 - x) / 0.5)


def product(a: Array, b: Array) -> Array:
    w, x, y, z = np.moveaxis(a, -1, 0)
    W, X, Y, Z = np.moveaxis(b, -1, 0)
    parts = [
        w * W - x * X - y * Y - z * Z, w * X + x * W + y * Z - z * Y,
        w * Y - x * Z + y * W + z * X, w * Z + x * Y - y * X + z * W,
    ]  # fmt: skip
    return np.stack(parts, -1)


def conjugate(q: Array) -> Array:
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def exponential(v: Any) -> Array:
    """(..., 4) of rotation vectors (..., 3), rad."""
    v = np.asarray(v, float)
    n = np.linalg.norm(v, axis=-1, keepdims=True)
    s = np.where(n < TINY, 0.5 - n * n / 48, np.sin(n / 2) / np.where(n == 0, 1, n))
    return np.concatenate([np.cos(n / 2), s * v], -1)


def logarithm(q: Array) -> Array:
    """(..., 3) rotation vectors (rad) of at most half a turn."""
    q = np.where(q[..., :1] < 0, -q, q)
    n = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(n, q[..., :1])
    return np.asarray(q[..., 1:] * np.where(n < TINY / 1000, 2, angle / np.where(n == 0, 1, n)))


def turned(q: Array, v: Any) -> Array:
    """v carried by q: from the body to the room where q is the body's attitude."""
    v = np.broadcast_to(v, (*q.shape[:-1], 3))
    u = q[..., 1:]
    t = 2 * np.cross(u, v)
    return np.asarray(v + q[..., :1] * t + np.cross(u, t))


def about(axis: int, angle: Any) -> Array:
    """Turn by angle (rad, any shape) about one of the axes."""
    v = np.zeros((*np.shape(angle), 3))
    v[..., axis] = angle
    return exponential(v)


def level(heading: float) -> Array:
    """(3,) horizontal unit vector at this heading (rad)."""
    return np.array([np.cos(heading), np.sin(heading), 0.0])


def band_noise(rng: np.random.Generator, n: int, rate: float, low: float, high: float) -> Array:
    """Noise of unit standard deviation between two corner frequencies (Hz)."""
    x = np.fft.rfft(rng.normal(size=n))
    f = np.fft.rfftfreq(n, 1 / rate)
    x *= 1 / (1 + (low / np.maximum(f, 1e-3)) ** 4) / (1 + (f / high) ** 4)
    y = np.fft.irfft(x, n)
    return np.asarray(y / (y.std() + 1e-12))


def flicker(rng: np.random.Generator, n: int, rate: float, B: float) -> Array:
    """1/f noise, one-sided density 2 B² / (2 π f), B in the unit of the reading."""
    f = np.fft.rfftfreq(n, 1 / rate)
    f[0] = f[1] if n > 1 else 1
    x = np.fft.rfft(rng.normal(size=n)) * np.sqrt(rate / 2 * 2 * B * B / (2 * np.pi * f))
    x[0] = 0
    return np.fft.irfft(x, n)


def moving_average(x: Array, m: int, order: int) -> Array:
    """A CIC decimation filter before it is thinned out: means of m, ``order`` times over."""
    for _ in range(order):
        c = np.cumsum(np.vstack([np.repeat(x[:1], m, 0), x]), 0)
        x = (c[m:] - c[:-m]) / m
    return x


def low_pass(x: Array, tau_s: float, rate: float) -> Array:
    """First order, at rest at the first reading."""
    a = np.exp(-1 / (rate * tau_s))
    return np.asarray(lfilter([1 - a], [1, -a], x, axis=0, zi=a * x[:1])[0])


def second_order(x: Array, corner_hz: float, rate: float, damping: float = 0.7) -> Array:
    """Two-pole low pass (n, 3), at rest at the first reading."""
    w = 2 * np.pi * corner_hz
    b, a = bilinear([w * w], [1, 2 * damping * w, w * w], rate)
    start = lfilter_zi(b, a)
    return np.column_stack([lfilter(b, a, c, zi=start * c[0])[0] for c in x.T])
