"""Medians and quantiles, bit-identical to NumPy's (linear between neighbours) and faster on small arrays.

NumPy takes ten to thirty microseconds for a few numbers, and holds the interpreter lock meanwhile.
"""

from collections.abc import Sequence

from trihedron import _core
from trihedron.arrays import FloatArray

MAD_TO_SIGMA = 1.4826
"""Standard deviation of a normal variate over its median absolute deviation."""


def median(values: FloatArray) -> float:
    """Median of ``values`` (n,); NaN for an empty array or one with a NaN."""
    return float(_core.column_medians(values.reshape(-1, 1))[0])


def medians(rows: FloatArray) -> FloatArray:
    """(c,) medians of the columns of ``rows`` (n, c)."""
    return _core.column_medians(rows)


def quantile(values: FloatArray, at: float) -> float:
    """Quantile ``at`` (0 to 1) of ``values`` (n,); NaN for an empty array or one with a NaN."""
    return float(_core.column_quantiles(values.reshape(-1, 1), [at])[0, 0])


def quantiles(rows: FloatArray, at: Sequence[float]) -> FloatArray:
    """(k, c) quantiles ``at`` (k,) of the columns of ``rows`` (n, c)."""
    return _core.column_quantiles(rows, list(at))
