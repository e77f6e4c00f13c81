"""Both sensors held against motion that is known beside the log (docs/reference.md)."""

from trihedron.estimate.reference.fit import fit_reference, moves_along

__all__ = ["fit_reference", "moves_along"]
