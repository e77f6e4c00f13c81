"""``trihedron check``."""

from __future__ import annotations


def check() -> None:
    """Say whether a log is fit for calibration, before anything is computed from it."""
    raise ValueError("not built yet")
