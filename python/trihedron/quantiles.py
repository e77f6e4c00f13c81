"""Medians and quantiles, to the last bit those of NumPy (linear between neighbours), without its many small steps.

NumPy takes ten to thirty microseconds over a handful of numbers, and holds the interpreter meanwhile.
"""

from __future__ import annotations

from collections.abc import Sequence

from trihedron import _core
from trihedron.arrays import FloatArray


def median(values: FloatArray) -> float:
    """Median of ``values`` (n,); NaN of none, and where one is."""
    return float(_core.column_medians(values.reshape(-1, 1))[0])


def medians(rows: FloatArray) -> FloatArray:
    """(c,) medians of the columns of ``rows`` (n, c)."""
    return _core.column_medians(rows)


def quantile(values: FloatArray, at: float) -> float:
    """Quantile ``at`` (0 to 1) of ``values`` (n,); NaN of none, and where one is."""
    return float(_core.column_quantiles(values.reshape(-1, 1), [at])[0, 0])


def quantiles(rows: FloatArray, at: Sequence[float]) -> FloatArray:
    """(k, c) quantiles ``at`` (k,) of the columns of ``rows`` (n, c)."""
    return _core.column_quantiles(rows, list(at))
