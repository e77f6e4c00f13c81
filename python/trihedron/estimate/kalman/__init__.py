"""Calibration by Kalman filter with the identified noise in its state (docs/kalman.md)."""

from trihedron.estimate.kalman.consistency import check_innovations
from trihedron.estimate.kalman.guide import Goal
from trihedron.estimate.kalman.identified import check_same_converter, check_same_gravity, noise_from_identified
from trihedron.estimate.kalman.live import LiveCalibration
from trihedron.estimate.kalman.norm_invariant import LiveNormCalibration, NormFrame, calibrate_without_references
from trihedron.estimate.kalman.norm_start import NormStart
from trihedron.estimate.kalman.per_axis import Prior, calibrate_with_references
from trihedron.estimate.kalman.session import (
    calibrate_session,
    calibrate_session_without_references,
    noise_from_poses,
    pose_readings,
)
from trihedron.estimate.kalman.shaping import ShapingOptions

__all__ = [
    "Goal",
    "LiveCalibration",
    "LiveNormCalibration",
    "NormFrame",
    "NormStart",
    "Prior",
    "ShapingOptions",
    "calibrate_session",
    "calibrate_session_without_references",
    "calibrate_with_references",
    "calibrate_without_references",
    "check_innovations",
    "check_same_converter",
    "check_same_gravity",
    "noise_from_identified",
    "noise_from_poses",
    "pose_readings",
]
