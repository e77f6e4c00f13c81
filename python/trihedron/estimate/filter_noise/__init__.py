"""Which N and K make a filter's predicted errors right, and what those errors are made of (docs/filter-noise.md)."""
