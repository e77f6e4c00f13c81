"""Nouns of noise: the Allan curve, and the noise terms of an axis with the certainty of each."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

AllanKind = Literal["overlapping", "non-overlapping", "modified", "hadamard", "total"]


class TermName(str, Enum):
    """The five terms of IEEE 952 by their symbols."""

    QUANTISATION = "Q"
    WHITE = "N"
    BIAS_INSTABILITY = "B"
    RATE_RANDOM_WALK = "K"
    RATE_RAMP = "R"


@dataclass(frozen=True, eq=False)
class AllanCurve:
    """Allan deviations of one or more channels against averaging time.

    ``clusters`` (k,) readings per cluster, ``tau_s`` (k,) the same in seconds; ``deviation`` (k, channels) in the unit
    of the readings, NaN where missing readings leave no term; ``lower``, ``upper`` (k, channels) a chi-square interval
    of ``confidence`` from ``edf`` (k, channels) equivalent degrees of freedom; ``n_terms`` (k, channels) terms summed,
    ``weight`` (k, channels) the sum of their weights (equal to ``n_terms`` without missing readings). ``stride`` is the
    distance of the starts of clusters too long for the memory: 1 unless the log was streamed.
    """

    kind: AllanKind
    rate_hz: float
    n_samples: int
    clusters: npt.NDArray[np.int64]
    deviation: FloatArray
    n_terms: npt.NDArray[np.int64]
    weight: FloatArray
    edf: FloatArray
    lower: FloatArray
    upper: FloatArray
    confidence: float = 0.95
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    stride: int = 1

    def __post_init__(self) -> None:
        k = len(self.clusters)
        shape = (k, self.deviation.shape[1])
        for name in ("deviation", "n_terms", "weight", "edf", "lower", "upper"):
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} must have shape {shape}, got {getattr(self, name).shape}")

    @property
    def tau_s(self) -> FloatArray:
        """(k,) averaging times, s."""
        return np.asarray(self.clusters / self.rate_hz, dtype=np.float64)

    @property
    def variance(self) -> FloatArray:
        """(k, channels) squared deviations."""
        return np.square(self.deviation)

    @property
    def n_channels(self) -> int:
        """Number of channels."""
        return int(self.deviation.shape[1])
