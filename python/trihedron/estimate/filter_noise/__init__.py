"""Which N and K make a filter's predicted errors right, and what those errors are made of (docs/filter-noise.md)."""

from trihedron.estimate.filter_noise.beside_reference import Asked, beside_reference
from trihedron.estimate.filter_noise.rests import at_rest, tilt_over_moves, unlike_axes

__all__ = ["Asked", "at_rest", "beside_reference", "tilt_over_moves", "unlike_axes"]
