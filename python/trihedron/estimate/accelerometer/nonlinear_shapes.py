"""Test whether the gravity errors in static poses have the shape of a nonlinear axis, part of which S and b absorb."""

import numpy as np

from trihedron import _core
from trihedron.estimate.accelerometer.norm import N_PARAMETERS
from trihedron.estimate.accelerometer.poses import PoseDesign
from trihedron.probability import FALSE_ALARM
from trihedron.records import Calibration, Finding, Segments
from trihedron.sensor_model import correct
from trihedron.transforms import directions_of

LEAST_POSES = 12
"""Poses from which three lengths of gravity are left beside the nine parameters of S and b."""
AS_WELL = float(np.log(20.0))
"""Difference of log-odds below which two shapes are not told apart."""


def with_shapes(calibration: Calibration, segments: Segments) -> tuple[Finding, ...]:
    """A calibration's findings, with a nonlinear shape in the gravity errors of static poses, where its odds against
    scatter of any size exceed those of a false alarm, and the shift of S and b that it causes (eq. 11.12c)."""
    fitted, reading = calibration.accelerometer, segments.accelerometer_mean
    if fitted.quality is None or reading is None or len(fitted.quality.residual) != len(reading):
        return calibration.findings
    seen, is_known = fitted.quality, np.isfinite(fitted.quality.residual)  # excluded poses have no residual
    up = directions_of(correct(reading, fitted.S, fitted.b))[is_known]
    g = calibration.gravity_m_s2
    # Faces of a case on a level table have six lengths, whatever else determines S and b.
    if len(up) < LEAST_POSES or PoseDesign.of(up, seen.sigma[is_known] / g).rank < N_PARAMETERS:
        return calibration.findings
    _, odds, shift = _core.errors_of_lengths(up, seen.residual[is_known] / g, seen.sigma[is_known] / g)
    best = max(odds)
    if best - np.log(len(odds)) < -np.log(FALSE_ALARM):
        return calibration.findings
    _, is_cubic, is_unlike = (one > best - AS_WELL for one in odds)
    said = Finding.of(
        "nonlinear-residual",
        "poses",
        is_quadratic=float(odds[0] == best),
        is_cubic=float(is_cubic),
        is_unlike=float(is_unlike),
        log10_odds=best / np.log(10.0),
        shift_m_s2=g * float(np.abs(shift).max()),
    )
    return (*calibration.findings, said)
