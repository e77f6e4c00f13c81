"""Gyro calibration: known turns (method 1) and moves between poses (method 2)."""

from trihedron.estimate.gyroscope.alignment import MoveOptions
from trihedron.estimate.gyroscope.gravity_scale import GravityScale, scale_by_gravity
from trihedron.estimate.gyroscope.moves import calibrate_moves
from trihedron.estimate.gyroscope.turn_angles import Turn
from trihedron.estimate.gyroscope.turn_axes import shared_errors, stated_turns
from trihedron.estimate.gyroscope.turns import calibrate_turns

__all__ = [
    "GravityScale",
    "MoveOptions",
    "Turn",
    "calibrate_moves",
    "calibrate_turns",
    "scale_by_gravity",
    "shared_errors",
    "stated_turns",
]
