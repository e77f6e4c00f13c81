"""Figures of merit of a calibration, with one definition for print and files."""

from typing import Any

import numpy as np

from trihedron.arrays import rms_of
from trihedron.records.calibration import Calibration, FitQuality

AT_REST = "one bias for the session"
AFTER_MOVES = "bias refitted per pose"
"""The bias used with the saved S for the tilt error after rotations, in words."""
IN_SAMPLE, HELD_OUT, BY_FILTER = "in sample", "cross-validated", "by the filter"
"""Labels of errors in every report: of the poses that were fitted, of each pose by a fit without it, and of poses by
the last parameters of the filter that ran through them."""


def counted_moves(quality: FitQuality) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(m,) the moves that were not excluded."""
    assert quality.angle_deg is not None
    seen = np.isfinite(quality.angle_deg)
    if quality.weights is not None and len(quality.weights) == len(seen):
        seen &= quality.weights > 0
    return seen


def published_figures(calibration: Calibration) -> dict[str, dict[str, Any]]:
    """Gravity error in static poses, rms [m/s²], and tilt error after rotations, rms [°], in sample and
    cross-validated, as plain JSON types.

    ``None`` where a figure cannot be cross-validated.
    """
    out: dict[str, dict[str, Any]] = {}
    quality = calibration.accelerometer.quality
    if quality is not None:
        out["gravity_error_in_static_poses"] = {
            "definition": f"| |S a' + b| - |g| | of the means of the poses, {AT_REST}",
            "unit": "m/s^2",
            "rms": float(quality.rms),
            "held_out_rms": None if quality.held_out_rms is None else float(quality.held_out_rms),
        }
    moved = None if calibration.gyroscope is None else calibration.gyroscope.quality
    if moved is not None and moved.angle_deg is not None:
        counted = counted_moves(moved)
        held = moved.held_out_angle_deg
        out["tilt_error_after_rotations"] = {
            "definition": f"angle between gravity carried by the gyro and gravity measured after a move, {AFTER_MOVES}",
            "unit": "deg",
            "rms": _rms(moved.angle_deg[counted]),
            "held_out_rms": None if held is None else _rms(held[counted & np.isfinite(held)]),
        }
    return out


def _rms(values: np.ndarray[Any, np.dtype[np.float64]]) -> float | None:
    return rms_of(values) if len(values) else None
