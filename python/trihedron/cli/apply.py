"""``trihedron apply``."""

from __future__ import annotations


def apply() -> None:
    """Apply a calibration to a log: readings in SI, CSV or Parquet."""
    raise ValueError("not built yet")
