"""Gyro calibration: known turns (method 1) and moves between still poses (method 2)."""

from trihedron.estimate.gyroscope.alignment import MoveOptions
from trihedron.estimate.gyroscope.moves import calibrate_moves

__all__ = ["MoveOptions", "calibrate_moves"]
