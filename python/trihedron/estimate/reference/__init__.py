"""Both sensors compared with reference motion (docs/reference.md)."""

from trihedron.estimate.reference.accelerometer import turns_of_frame
from trihedron.estimate.reference.fit import fit_reference, fit_references, moves_along
from trihedron.estimate.reference.gyroscope import poses_at_rest

__all__ = ["fit_reference", "fit_references", "moves_along", "poses_at_rest", "turns_of_frame"]
