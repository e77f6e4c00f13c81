"""Signatures of the compiled core. A test compares this stub with the runtime."""

from trihedron.records.calibration import FloatArray

# rotation
def rotation_from_vector(vectors: FloatArray) -> FloatArray: ...
def vector_from_rotation(rotations: FloatArray) -> FloatArray: ...
