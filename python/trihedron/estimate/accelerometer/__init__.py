"""Accelerometer triad from poses: method 1 (faces of the case) and method 2 (norm of gravity, any pose)."""

from trihedron.estimate.accelerometer.ellipsoid import ellipsoid
from trihedron.estimate.accelerometer.face_placements import shared_rounding
from trihedron.estimate.accelerometer.faces import calibrate_faces
from trihedron.estimate.accelerometer.norm import calibrate_norm
from trihedron.estimate.accelerometer.whole_turns import OppositeHeadings, opposite_headings

__all__ = [
    "OppositeHeadings",
    "calibrate_faces",
    "calibrate_norm",
    "ellipsoid",
    "opposite_headings",
    "shared_rounding",
]
