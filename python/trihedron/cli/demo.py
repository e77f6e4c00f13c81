"""``trihedron demo``."""

from __future__ import annotations


def demo() -> None:
    """A complete session, simulated: calibrate, verify, report, and compare with the truth."""
    raise ValueError("not built yet")
