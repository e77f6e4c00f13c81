"""Allan deviation of arrays and of logs that are read in chunks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.special import chdtri

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.errors import InputError
from trihedron.records.allan_curve import AllanCurve, AllanKind

_LONGEST = {"overlapping": 2, "non-overlapping": 2, "modified": 3, "hadamard": 3, "total": 2}

KINDS = {
    "overlapping": _core.AllanKind.Overlapping,
    "non-overlapping": _core.AllanKind.NonOverlapping,
    "modified": _core.AllanKind.Modified,
    "hadamard": _core.AllanKind.Hadamard,
    "total": _core.AllanKind.Total,
}

CLUSTERS_AN_OCTAVE = 4

STREAM_BUDGET_BYTES = 384 << 20
"""Memory for running sums of a streamed log, all channels together."""


def default_clusters(n: int, kind: AllanKind = "overlapping") -> list[int]:
    """Cluster sizes from 1 reading to the longest with a term, four per octave."""
    longest = max(1, n // _LONGEST[kind])
    steps = np.arange(int(CLUSTERS_AN_OCTAVE * math.log2(longest)) + 1)
    return [int(m) for m in np.unique(np.round(2.0 ** (steps / CLUSTERS_AN_OCTAVE)).astype(np.int64))]


def allan_deviation(
    x: npt.ArrayLike,
    rate_hz: float,
    clusters: Sequence[int] | IntArray | None = None,
    kind: AllanKind = "overlapping",
    *,
    confidence: float = 0.95,
    names: Sequence[str] = (),
    units: Sequence[str] = (),
) -> AllanCurve:
    """Allan deviation of rate (not phase) readings with chi-square intervals (docs/noise.md, eq. 1-6).

    A series (n,) gives arrays (k,), channels side by side (n, channels) give arrays (k, channels).

    Parameters
    ----------
    x : (n,) or (n, channels)
        Equally spaced readings in any unit, float64, float32, int16 or int32 (not copied when C-contiguous). NaN marks
        a missing reading; clusters are then means of the readings present, weighted by their number, with the
        scatter of such means about those of all readings subtracted (docs/noise.md, section 1).
    rate_hz : float
        Samples per second.
    clusters : (k,) of int, optional
        Readings per cluster; by default four to the octave up to the longest with a term.
    kind : str
        ``overlapping`` uses every start; see :data:`~trihedron.records.noise.AllanKind`.
    confidence : float
        Confidence level of the intervals.
    names, units : sequence of str
        One per channel, for reports.

    Returns
    -------
    AllanCurve
        ``tau_s`` (k,), ``deviation`` (k, channels) in the unit of the readings, with a 95 % interval.

    Raises
    ------
    ValueError
        When the log is too short, a cluster size has no term, or the kind does not allow missing readings.

    Examples
    --------
    >>> import numpy as np, trihedron
    >>> curve = trihedron.allan_deviation(np.random.default_rng(1).normal(size=10000), 100.0, clusters=[1, 100])
    >>> curve.deviation.shape, [round(float(d), 2) for d in curve.deviation]
    ((2,), [1.0, 0.09])
    """
    if isinstance(names, str) or isinstance(units, str):
        raise InputError("names and units are lists, one text for each channel.")
    readings = as_readings(x)
    check_question(rate_hz, kind, confidence)
    if len(readings) < _LONGEST[kind]:
        raise InputError(f"an Allan deviation needs at least {_LONGEST[kind]} readings, got {len(readings)}")
    curve = curve_of([readings], rate_hz, clusters, tuple(names), tuple(units), kind, confidence)
    return curve.of_one_series() if np.ndim(x) == 1 else curve


def curve_of(
    parts: Sequence[FloatArray],
    rate_hz: float,
    clusters: Sequence[int] | IntArray | None,
    names: tuple[str, ...],
    units: tuple[str, ...],
    kind: AllanKind = "overlapping",
    confidence: float = 0.95,
) -> AllanCurve:
    """Curve of the channels of ``parts``, arrays (n, channels) each."""
    n = len(parts[0])
    sizes = default_clusters(n, kind) if clusters is None else checked_clusters(clusters)
    found = [_core.allan_variance(part, sizes, KINDS[kind]) for part in parts]
    variance, terms, weight = (np.concatenate([one[k] for one in found]).T for k in range(3))
    return curve_with_intervals(
        kind, rate_hz, n, np.array(sizes), variance, terms.astype(np.int64), weight, confidence, names, units
    )


def as_readings(x: npt.ArrayLike) -> FloatArray:
    """Readings as a C-contiguous array (n, channels) of a type the kernel reads, copied only where needed."""
    array = np.asarray(x)
    if array.ndim == 1:
        array = array[:, np.newaxis]
    if array.ndim != 2 or array.shape[1] == 0:
        raise InputError(f"readings must have shape (n,) or (n, channels), got {np.shape(x)}")
    if array.dtype not in (np.float64, np.float32, np.int16, np.int32):
        if array.dtype.kind not in "iufb":
            raise InputError(f"readings must be real numbers, got the type {array.dtype}")
        array = array.astype(np.float64)
    # The kernel reads all four types; signatures name float64 for any of them.
    return np.ascontiguousarray(array)


def check_question(rate_hz: float, kind: str, confidence: float) -> None:
    """Check the arguments of an Allan deviation; raises ``InputError`` naming the argument."""
    if not (math.isfinite(rate_hz) and rate_hz > 0):
        raise InputError(f"rate_hz must be a positive number of samples per second, got {rate_hz}")
    if kind not in KINDS:
        raise InputError(f"kind must be one of {', '.join(KINDS)}; got {kind!r}")
    if not 0.0 < confidence < 1.0:
        raise InputError(f"confidence must lie between 0 and 1, got {confidence}")


def checked_clusters(clusters: Sequence[int] | IntArray) -> list[int]:
    """Cluster sizes as integers; raises ``InputError`` when one is not a whole number of at least 1."""
    sizes = np.atleast_1d(np.asarray(clusters))
    if sizes.ndim != 1 or sizes.size == 0:
        raise InputError("clusters must be a list of cluster sizes in readings")
    whole = np.asarray(sizes, dtype=np.float64)
    if not np.all(np.isfinite(whole)) or np.any(whole != np.round(whole)) or np.any(whole < 1):
        raise InputError("clusters are counted in readings: whole numbers of at least 1 (averaging time times rate)")
    return [int(m) for m in whole]


def curve_with_intervals(
    kind: AllanKind,
    rate_hz: float,
    n: int,
    clusters: IntArray,
    variance: FloatArray,
    terms: IntArray,
    weight: FloatArray,
    confidence: float,
    names: tuple[str, ...],
    units: tuple[str, ...],
    stride: int = 1,
) -> AllanCurve:
    """The curve with its degrees of freedom and chi-square intervals; the noise type follows from the local slope."""
    sizes, channels = [int(m) for m in clusters], variance.shape[1]
    along = [
        _core.allan_degrees_along(n, sizes, v.tolist(), w.tolist(), KINDS[kind])
        for v, w in zip(variance.T, weight.T, strict=True)
    ]
    edf, bias = (np.column_stack(figures) for figures in zip(*along, strict=True))
    tail = (1.0 - confidence) / 2.0
    high, low = (chdtri(edf, above) for above in (tail, 1.0 - tail))
    return AllanCurve(
        kind=kind,
        rate_hz=float(rate_hz),
        n_samples=n,
        clusters=np.asarray(clusters, dtype=np.int64),
        deviation=np.sqrt(variance),
        n_terms=np.asarray(terms, dtype=np.int64),
        weight=weight,
        edf=edf,
        lower=np.sqrt(variance / bias * edf / high),
        upper=np.sqrt(variance / bias * edf / low),
        confidence=confidence,
        names=names or tuple(f"channel {c + 1}" for c in range(channels)),
        units=units or ("",) * channels,
        stride=stride,
    )
