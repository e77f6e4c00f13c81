"""``trihedron verify``."""

from __future__ import annotations


def verify() -> None:
    """Test a calibration on another recording."""
    raise ValueError("not built yet")
