"""The record of an Allan curve."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.records.frozen import Frozen

AllanKind = Literal["overlapping", "non-overlapping", "modified", "hadamard", "total"]

_PER_CHANNEL = ("deviation", "n_terms", "weight", "edf", "lower", "upper")


@dataclass(frozen=True, eq=False, repr=False)
class AllanCurve(Frozen):
    """Allan deviations of one or more channels against averaging time. For a single series all arrays are (k,).

    Attributes
    ----------
    clusters, tau_s : (k,)
        Readings per cluster, and the same in seconds.
    deviation, lower, upper : (k, channels)
        In the readings' unit, NaN without readings, with the chi-square interval of ``confidence`` (0 to 1).
    edf, n_terms, weight : (k, channels)
        Equivalent degrees of freedom; number of terms summed, and the sum of their weights (equal without gaps).
    kind, rate_hz, n_samples, names, units
        The estimator (overlapping or not) and the log; ``names`` and ``units`` by channel. ``stride`` is the distance
        in readings between the starts of clusters: 1, except for long clusters of a streamed log.

    Examples
    --------
    >>> curve = trihedron.allan_deviation(recording.gyroscope[:, 0], recording.rate_hz)
    >>> curve.tau_s.shape == curve.deviation.shape
    True
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
        return int(self.deviation.shape[1]) if self.deviation.ndim == 2 else 1

    def of_one_series(self) -> AllanCurve:
        """The curve of one channel with arrays (k,) instead of (k, 1); a ``ValueError`` for several channels."""
        if self.n_channels > 1:
            raise InputError(f"this curve is of {self.n_channels} channels, not of one series")
        flat = {name: getattr(self, name).reshape(-1) for name in _PER_CHANNEL}
        return replace(self, **flat)

    def __repr__(self) -> str:
        span = f"{self.tau_s[0]:.4g} to {self.tau_s[-1]:.4g} s" if len(self.clusters) else "no averaging time"
        channels = f"{self.n_channels} channel{'s' if self.n_channels > 1 else ''}"
        return f"<AllanCurve {self.kind}: {channels}, {len(self.clusters)} averaging times from {span}>"
