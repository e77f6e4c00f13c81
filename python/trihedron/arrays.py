"""Names of the arrays that pass between rooms; shapes and units are in each docstring. And who holds their memory."""

import numpy as np
import numpy.typing as npt

from trihedron import _core

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

CORE_MEMORY = type(_core.room(1, 1).base)
"""What holds the memory of an array that the core made; nobody reaches the numbers through it."""
AXES = ("x", "y", "z")
"""The axes of a triad: columns of every (n, 3) array."""
XYZ = ("X", "Y", "Z")
"""The same as reports print them, and a silkscreen."""
