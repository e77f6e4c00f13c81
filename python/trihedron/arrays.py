"""Types of the arrays that pass between modules (shapes and units are in each docstring), and names of axes."""

import numpy as np
import numpy.typing as npt

from trihedron import _core

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

CORE_MEMORY = type(_core.new_array(1, 1).base)
"""Type of the object that owns the memory of an array made by the core; it gives no write access to the values."""
AXES = ("x", "y", "z")
"""The axes of a triad: columns of every (n, 3) array."""
TINY = 1e-300
"""Least divisor, variance and probability: nothing measured is as small, and its inverse is finite."""
XYZ = ("X", "Y", "Z")
"""The axes as printed in reports and on a silkscreen."""


def rms_of(values: npt.ArrayLike) -> float:
    """Root mean square of all values; NaN of none."""
    squares = np.square(values)
    return float(np.sqrt(np.mean(squares))) if squares.size else float("nan")


def sigmas_of(covariance: FloatArray) -> FloatArray:
    """(n,) standard errors of a covariance (n, n); 0 where rounding made a variance negative."""
    return np.asarray(np.sqrt(np.maximum(np.diag(covariance), 0.0)))
