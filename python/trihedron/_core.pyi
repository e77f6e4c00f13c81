"""Signatures of the compiled core. A test compares this stub with the runtime."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

# rotation
def rotation_from_vector(vectors: FloatArray) -> FloatArray: ...
def vector_from_rotation(rotations: FloatArray) -> FloatArray: ...
