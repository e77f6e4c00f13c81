"""``trihedron segment``."""

from __future__ import annotations


def segment() -> None:
    """Find the still poses and the moves between them."""
    raise ValueError("not built yet")
