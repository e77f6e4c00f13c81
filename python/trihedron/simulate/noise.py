"""Sensor noise with exact discrete statistics: Q, N, B, K, R per axis, each from its own stream of random numbers."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Triple: TypeAlias = tuple[float, float, float]

_NONE: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class NoiseTerms:
    """Coefficients of the five terms per axis, SI, as METHODS of Allan variance define them.

    With u the unit of the signal (rad/s or m/s²): ``Q`` quantisation [u·s], ``N`` white [u·√s = u/√Hz], ``B`` bias
    instability [u] (1/f: σ² = (2 ln 2/π) B²), ``K`` rate random walk [u/√s], ``R`` ramp [u/s].
    """

    Q: Triple = _NONE
    N: Triple = _NONE
    B: Triple = _NONE
    K: Triple = _NONE
    R: Triple = _NONE

    def __post_init__(self) -> None:
        for name in "QNBK":
            if any(not np.isfinite(v) or v < 0.0 for v in getattr(self, name)):
                raise ValueError(f"noise term {name} must hold three numbers that are not negative")


def stream(seed: int, stage: str) -> np.random.Generator:
    """Random numbers of one stage: they depend on the seed and the stage's name only."""
    return np.random.default_rng(np.random.SeedSequence([seed, zlib.crc32(stage.encode())]))


def make_noise(terms: NoiseTerms, n: int, dt: float, seed: int, sensor: str) -> FloatArray:
    """(n, 3) noise at step ``dt`` [s], unit of the signal.

    Per step: N/√dt white; K√dt the increments of a walk that starts at zero; Q/dt the first difference of white.
    """
    out = np.zeros((n, 3))
    for axis in range(3):
        if terms.N[axis]:
            out[:, axis] += terms.N[axis] / np.sqrt(dt) * stream(seed, f"{sensor}/N/{axis}").standard_normal(n)
        if terms.K[axis]:
            steps = stream(seed, f"{sensor}/K/{axis}").standard_normal(n)
            out[:, axis] += terms.K[axis] * np.sqrt(dt) * (np.cumsum(steps) - steps[0])
        if terms.Q[axis]:
            out[:, axis] += terms.Q[axis] / dt * np.diff(stream(seed, f"{sensor}/Q/{axis}").standard_normal(n + 1))
        if terms.R[axis]:
            out[:, axis] += terms.R[axis] * dt * np.arange(n)
    return out
