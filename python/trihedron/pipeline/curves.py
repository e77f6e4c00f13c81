"""Allan deviations of what a program holds: a series gives arrays (k,), channels side by side (k, channels)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from trihedron.estimate.noise import allan_deviation as of_channels
from trihedron.records import AllanCurve
from trihedron.records.noise import AllanKind


def allan_deviation(
    x: npt.ArrayLike,
    rate_hz: float,
    clusters: Sequence[int] | npt.NDArray[np.int64] | None = None,
    kind: AllanKind = "overlapping",
    *,
    confidence: float = 0.95,
    names: Sequence[str] = (),
    units: Sequence[str] = (),
) -> AllanCurve:
    """Allan deviation of rate (not phase) readings with chi-square intervals (docs/noise.md, eq. 1-6).

    Parameters
    ----------
    x : (n,) or (n, channels)
        Equally spaced readings in any unit; NaN marks a missing one. A series (n,) gives arrays (k,).
    rate_hz : float
        Samples per second.
    clusters : (k,) of int, optional
        Readings per cluster; by default four to the octave up to the longest with a term.
    kind
        ``overlapping``, ``non-overlapping``, ``modified``, ``hadamard`` or ``total``.

    Raises
    ------
    ValueError
        When the log is too short, a cluster size has no term, or the kind does not allow missing readings.

    Examples
    --------
    >>> import numpy as np, trihedron
    >>> curve = trihedron.allan_deviation(np.random.default_rng(1).normal(size=10000), 100.0, clusters=[1, 100])
    >>> curve.deviation.shape, [round(float(d), 2) for d in curve.deviation]
    ((2,), [1.0, 0.1])
    """
    if isinstance(names, str) or isinstance(units, str):
        raise ValueError("names and units are lists, one text for each channel.")
    curve = of_channels(x, rate_hz, clusters, kind, confidence=confidence, names=names, units=units)
    return curve.of_one_series() if np.ndim(x) == 1 else curve
