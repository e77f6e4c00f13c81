"""A session of poses and moves in the frame of a case, which stood on its faces and was turned on them."""

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.estimate.accelerometer.face_poses import direction_of
from trihedron.estimate.accelerometer.faces import tilt_findings
from trihedron.estimate.case_frame import (
    TABLE,
    TURN,
    OnFaces,
    across_faces,
    at_headings,
    fit_case,
    spread_over,
)
from trihedron.estimate.gyroscope.stated_turns import TableTurns
from trihedron.estimate.gyroscope.turntable import moved_to, parameters_of
from trihedron.records import Calibration, Recording, Segments
from trihedron.sensor_model import correct, turned
from trihedron.transforms import cross_matrix, directions_of, rotation_by

PASSES, SETTLED_RAD = 10, 1e-7
"""Most fits, each about the rotation by the one before, and the step at which they end: rows are linear but in it."""


def in_case_frame(
    calibration: Calibration, turns: TableTurns, recording: Recording, segments: Segments, up: IntArray
) -> Calibration:
    """The calibration of poses and moves in the frame of a case with face ``up`` (n,) in each pose (0: none), updated
    with the axes that gravity on its faces and ``turns`` on them show."""
    means, sigma = segments.accelerometer_mean, segments.accelerometer_sigma_mean
    assert means is not None
    assert sigma is not None
    used, g = np.flatnonzero(up), calibration.gravity_m_s2
    n = len(used)
    faces, noise = up[used], sigma[used, :, None] ** 2 * np.eye(3)
    poses = OnFaces(means[used], noise, faces, np.full(n, g), np.ones(n))
    headings, placement = _placed(up, turns)
    table = spread_over(at_headings(faces, headings[used]), placement[used])
    sensor = calibration.accelerometer
    R = _nearest(faces, directions_of(correct(means[used], sensor.S, sensor.b)))
    for _ in range(PASSES):
        near = turned(calibration, R)
        assert near.gyroscope is not None
        values = parameters_of(near)
        rows = poses.rows(near.accelerometer.S, across_faces(faces), 0, 24)
        rows = replace(rows, leans={TABLE: table} | poses.face_leans())
        of_turns = None
        if turns.moves:
            on_faces = _on_faces(turns, up)
            of_turns = on_faces.rows(near.gyroscope.S, across_faces(on_faces.faces), 12, 24)
            own = np.diag(np.repeat(1.0 / np.abs(turns.angles), 2))
            of_turns = replace(of_turns, leans={TURN: own} | on_faces.face_leans())
        fit = fit_case(values, near.covariance, _rotations(values), rows, of_turns)
        R = rotation_by(fit.steps) @ R
        if np.max(np.abs(fit.steps)) < SETTLED_RAD:
            break
    after = moved_to(near, fit.values, fit.covariance, recording, segments)
    off = correct(means[used], after.accelerometer.S, after.accelerometer.b) - g * direction_of(faces)
    said = tilt_findings(fit.sizes.get(TABLE, 0.0), fit, faces, off, used)
    return replace(after, findings=(*calibration.findings, *said))


def _placed(up: IntArray, turns: TableTurns) -> tuple[FloatArray, IntArray]:
    """Heading (n,) [rad] of each pose in its placement, and the number of that: turns keep the case on the table."""
    headings, placement = np.zeros(len(up)), np.arange(len(up))
    for move, angle in zip(turns.moves, turns.angles, strict=True):
        before, after = move.pose_before, move.pose_after
        if up[before] == up[after]:
            headings[after], placement[after] = headings[before] + angle, placement[before]
    return headings, placement


def _on_faces(turns: TableTurns, up: IntArray) -> OnFaces:
    variance = turns.variance + np.sum(turns.hidden**2, axis=2)
    faces = up[[move.pose_before for move in turns.moves]]
    return OnFaces(turns.raw_angle, variance[:, :, None] * np.eye(3), faces, turns.angles, turns.duration_s)


def _nearest(faces: IntArray, up: FloatArray) -> FloatArray:
    """The rotation (3, 3) that brings verticals ``up`` (n, 3) nearest to the axes of the case (Kabsch)."""
    u, _, vt = np.linalg.svd(direction_of(faces).T @ up)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


def _rotations(values: FloatArray) -> FloatArray:
    """(24, 3) derivatives of the parameters by a rotation vector of the frame."""
    out = []
    for axis in np.eye(3):
        cross = cross_matrix(axis)
        out.append([np.append((cross @ of[:9].reshape(3, 3)).ravel(), cross @ of[9:]) for of in np.split(values, 2)])
    return np.asarray(np.reshape(out, (3, 24)).T)
