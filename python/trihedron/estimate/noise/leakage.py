"""End effects of a cosine transform on 1/f noise."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray

_ORDERS = 32


@lru_cache(maxsize=1)
def _table() -> FloatArray:
    """Expectation of a cosine coefficient of 1/f noise over the density at its frequency, orders 1 to 32."""
    n, pad = 512, 1 << 14
    k = np.arange(n)
    omega = 2.0 * np.pi * np.arange(1, pad // 2) / pad
    order = np.arange(1, _ORDERS + 1)
    shape = math.sqrt(2.0 / n) * np.cos(np.pi * order[:, np.newaxis] * (2 * k + 1) / (2 * n))
    gain = np.abs(np.fft.rfft(shape, pad, axis=1)[:, 1 : pad // 2]) ** 2
    power = 2.0 * np.sum(gain * (0.5 / np.sin(omega / 2.0)), axis=1) / pad
    return np.asarray(power * 2.0 * np.sin(np.pi * order / (2 * n)))


def flicker_leakage(order: npt.NDArray[np.int64]) -> FloatArray:
    """Factor by which end effects change the expected power of 1/f noise at the lowest orders: 0.77, 0.90, 0.93 … 1."""
    table = _table()
    out = np.ones(len(order))
    low = order <= _ORDERS
    out[low] = table[order[low] - 1]
    return out
