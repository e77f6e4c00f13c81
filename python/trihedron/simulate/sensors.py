"""The two sensors of the instrument, each stage with physical parameters; zero means that the stage is not there."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from trihedron.simulate.noise import NoiseTerms
from trihedron.units import AccelerationUnit, RateUnit

FloatArray = npt.NDArray[np.float64]
Triple: TypeAlias = tuple[float, float, float]
Matrix: TypeAlias = tuple[Triple, Triple, Triple]

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Adc:
    """Converter in raw units: ``lsb`` step (0: none), range ``[low, high]`` (infinite: none)."""

    lsb: float = 0.0
    low: float = -float("inf")
    high: float = float("inf")

    def convert(self, raw: FloatArray) -> FloatArray:
        """Clip to the range, then round to the nearest code."""
        out = np.clip(raw, self.low, self.high)
        return np.round(out / self.lsb) * self.lsb if self.lsb > 0.0 else out


@dataclass(frozen=True)
class Accelerometer:
    """``raw = S^-1 (f - b)`` for the linear instrument, direct form S [m/s² per raw unit], b [m/s²]."""

    S: Matrix = IDENTITY
    b: Triple = (0.0, 0.0, 0.0)
    unit: AccelerationUnit = AccelerationUnit.M_S2
    noise: NoiseTerms = field(default_factory=NoiseTerms)
    adc: Adc = field(default_factory=Adc)


@dataclass(frozen=True)
class Gyroscope:
    """``raw = S^-1 (ω - b)`` for the linear instrument, direct form S [rad/s per raw unit], b [rad/s]."""

    S: Matrix = IDENTITY
    b: Triple = (0.0, 0.0, 0.0)
    unit: RateUnit = RateUnit.RAD_S
    noise: NoiseTerms = field(default_factory=NoiseTerms)
    adc: Adc = field(default_factory=Adc)


def sense_axes(S: Matrix, name: str) -> tuple[FloatArray, FloatArray]:
    """Unit sensitive directions (3, 3), row by row, and gains (3,) raw per SI: ``S^-1 = diag(gain) · directions``.

    Raises
    ------
    ValueError
        When S cannot be inverted.
    """
    matrix = np.asarray(S, dtype=np.float64)
    if matrix.shape != (3, 3) or not np.all(np.isfinite(matrix)) or np.linalg.cond(matrix) > 1e12:
        raise ValueError(f"S of the {name} must be an invertible 3x3 matrix, got {matrix.tolist()}")
    inverse = np.linalg.inv(matrix)
    gain: FloatArray = np.linalg.norm(inverse, axis=1)
    return inverse / gain[:, None], gain
