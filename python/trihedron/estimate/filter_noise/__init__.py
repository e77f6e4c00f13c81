"""Which N and K make a filter's predicted errors right, and what else those errors are made of (docs/filter-noise.md)."""

from trihedron.estimate.filter_noise.beside_reference import Asked, beside_reference

__all__ = ["Asked", "beside_reference"]
