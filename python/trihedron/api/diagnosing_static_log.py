"""Diagnose logs of one or two orientations: static logs, temperature chambers, a table that does not turn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from trihedron.api.reading import FEWEST_POSES
from trihedron.diagnose.session.starting_point import is_open
from trihedron.diagnose.static_log import diagnose_static_log
from trihedron.errors import INPUT_ERRORS
from trihedron.records import Calibration, Finding, Recording, Segments
from trihedron.records.diagnosis import Diagnosis, LinearModel
from trihedron.segment.static_pieces import static_pieces
from trihedron.transforms import directions_of
from trihedron.units import acceleration_to_si, rate_to_si

Calibrated = Callable[[], Calibration]
"""The recording's own calibration, computed on first use; raises what ``calibrate`` raises."""
SAME_POSE_RAD = 0.15
"""Poses whose gravity points less than 9° apart are one orientation."""
TWO_ORIENTATIONS = 2
MOSTLY = 0.9
"""Fraction of the static time in two orientations from which all other poses count as handling."""
TURNED_RAD, MOST_TURNS = 0.7, 2
"""Rotation [rad] (40°) from which a move counts as a turn, and the most turns of a log of one or two orientations."""


def is_static_log(recording: Recording, segments: Segments, calibrated: Calibrated) -> bool:
    """Whether the log has one or two orientations, or too few poses for a session."""
    mean = segments.accelerometer_mean
    if mean is None or segments.n_poses < FEWEST_POSES:
        return True
    up = directions_of(mean)
    lasts = np.array([pose.stop - pose.start for pose in segments.poses], dtype=np.float64)
    of_orientations = []
    free = np.ones(len(up), dtype=bool)
    while free.any():
        first = int(np.flatnonzero(free)[lasts[free].argmax()])
        near = free & (np.arccos(np.clip(up @ up[first], -1.0, 1.0)) < SAME_POSE_RAD)
        of_orientations.append(float(lasts[near].sum()))
        free &= ~near
    # Unsigned counts with a large offset all point the same way: only a fit shows whether they are a session.
    is_known = acceleration_to_si(recording.accelerometer_unit) is not None
    if is_known and len(of_orientations) <= TWO_ORIENTATIONS:
        return _turns(recording, segments) <= MOST_TURNS
    longest = sum(sorted(of_orientations)[-TWO_ORIENTATIONS:])
    if longest < MOSTLY * sum(of_orientations):
        return False
    try:
        own = calibrated()
    except INPUT_ERRORS:
        return True
    return is_open(own)


def _turns(recording: Recording, segments: Segments) -> int:
    """Number of moves beyond ``TURNED_RAD`` by the gyro: gravity does not show a turn about the vertical."""
    scale = rate_to_si(recording.gyroscope_unit)
    if recording.gyroscope is None or scale is None or segments.gyroscope_mean is None:
        return 0
    bias = segments.gyroscope_mean.mean(axis=0)
    step = 1.0 / recording.rate_hz
    turned = [
        float(np.linalg.norm(np.nansum(recording.gyroscope[m.start : m.stop] - bias, axis=0))) * scale * step
        for m in segments.moves
    ]
    return sum(angle > TURNED_RAD for angle in turned)


def of_static_log(
    recording: Recording, segments: Segments, model: Calibration, gravity: float, alpha: float
) -> tuple[Diagnosis, Finding]:
    """The diagnosis of a log of one or two orientations, which ``model`` converts to SI, and a finding that says so."""
    linear = LinearModel.of_sensors(model.accelerometer, model.gyroscope)
    lasts = float(recording.time_s[-1] - recording.time_s[0])
    few = Finding.of("not-fit", "few-orientations", duration_s=lasts, n_poses=segments.n_poses)
    return diagnose_static_log(recording, static_pieces(recording), linear, gravity, alpha), few
