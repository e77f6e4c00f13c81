"""Both sensors compared with reference motion (docs/reference.md)."""

from trihedron.estimate.reference.fit import fit_reference, fit_references, moves_along
from trihedron.estimate.reference.start import poses_at_rest

__all__ = ["fit_reference", "fit_references", "moves_along", "poses_at_rest"]
