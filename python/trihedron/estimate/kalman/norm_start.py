"""Where the calibration without reference attitudes starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.arrays import XYZ, FloatArray
from trihedron.errors import RefusedError


@dataclass(frozen=True, eq=False)
class NormStart:
    """Where the filter starts: ``f = S (raw − zero)`` with S (3, 3) and bias (3,).

    S is good to ``sigma_relative`` of its size, the bias to ``sigma_bias_m_s2``. The signs of S decide
    the signs of the result: the length of a vector cannot.
    """

    S: FloatArray
    bias: FloatArray
    sigma_relative: float = 0.1
    sigma_bias_m_s2: float = 1.0

    def __post_init__(self) -> None:
        S, bias = np.array(self.S, dtype=np.float64), np.array(self.bias, dtype=np.float64)
        if S.shape != (3, 3) or bias.shape != (3,) or not (np.all(np.isfinite(S)) and np.all(np.isfinite(bias))):
            raise RefusedError(f"a start needs finite S (3, 3) and bias (3,), got shapes {S.shape} and {bias.shape}")
        if np.linalg.matrix_rank(S) < 3:
            raise RefusedError(
                "a start needs three independent axes: S = 0 is no calibration, but the filter would stay there"
            )
        if not (self.sigma_relative > 0 and self.sigma_bias_m_s2 > 0):
            raise RefusedError("the uncertainty of a start must be positive")
        object.__setattr__(self, "S", S)
        object.__setattr__(self, "bias", bias)

    @classmethod
    def nominal(cls, si_per_raw: float, bias: npt.ArrayLike = (0.0, 0.0, 0.0)) -> NormStart:
        """The data sheet: one scale [m/s² per raw unit] for all axes, and the bias."""
        return cls(si_per_raw * np.eye(3), np.asarray(bias, dtype=np.float64))

    @classmethod
    def from_range(cls, readings: npt.ArrayLike, gravity_m_s2: float) -> NormStart:
        """A guess from mean readings (n, 3) alone: each axis has been near the vertical, both ways up.

        Raises
        ------
        ValueError
            When an axis did not move.
        """
        a = np.asarray(readings, dtype=np.float64)
        half = (a.max(axis=0) - a.min(axis=0)) / 2.0
        if np.any(half <= 0):
            raise RefusedError(f"{XYZ[int(np.argmin(half))]} never changed: turn it both ways up, or give a start")
        bias = (a.max(axis=0) + a.min(axis=0)) / 2.0
        return cls(np.diag(gravity_m_s2 / half), bias, sigma_relative=0.3, sigma_bias_m_s2=3.0)
