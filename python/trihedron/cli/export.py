"""``trihedron export``."""

from __future__ import annotations


def export() -> None:
    """Write a calibration for other programs: C, Python, Kalibr, imu_tk."""
    raise ValueError("not built yet")
