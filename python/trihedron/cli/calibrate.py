"""``trihedron calibrate``."""

from __future__ import annotations


def calibrate() -> None:
    """Calibrate both sensors from a log of still poses and moves."""
    raise ValueError("not built yet")
