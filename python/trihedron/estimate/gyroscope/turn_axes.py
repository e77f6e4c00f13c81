"""Known turns on a table, and their axes in the body frame: of the case, or by the accelerometer in any pose."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.errors import InputError
from trihedron.estimate.gravity_circle import gravity_circle
from trihedron.estimate.gyroscope.turn_angles import Turn
from trihedron.records.calibration import SensorCalibration
from trihedron.records.recording import Recording
from trihedron.records.segments import Move, Segments

SAME_POSE_RAD = math.radians(5.0)
"""Largest change of gravity's direction in a turn on a table: twice the table's tilt, which is two degrees at most."""
TABLE_TILT_RAD = math.radians(1.0)
"""Standard uncertainty of the table's tilt where a turn does not show it: rooms and tables are built to half of it."""
SEEN_TURN_RAD = math.radians(60.0)
"""Smallest turn whose axis is fitted: gravity must cover enough of its circle in the body frame."""


def moves_on_faces(segments: Segments, up: IntArray) -> list[Move]:
    """Moves that begin and end on one face of the case, ``up`` (n,) in every pose (0: none)."""
    return [one for one in _moves(segments) if up[one.pose_before] == up[one.pose_after] != 0]


def moves_about_vertical(segments: Segments, accelerometer: SensorCalibration, gravity_m_s2: float) -> list[Move]:
    """Moves that do not change gravity's direction (within ``SAME_POSE_RAD``): turns on a table by any angle."""
    assert segments.accelerometer_mean is not None
    force = segments.accelerometer_mean @ accelerometer.S.T + accelerometer.b
    limit = 2.0 * gravity_m_s2 * math.sin(0.5 * SAME_POSE_RAD)
    return [one for one in _moves(segments) if np.linalg.norm(force[one.pose_after] - force[one.pose_before]) < limit]


def _moves(segments: Segments) -> Iterator[Move]:
    return (move for move in segments.moves if move.stop - move.start >= 2)


def _stated(recording: Recording, moves: list[Move], angles_deg: Sequence[float]) -> list[tuple[Move, float]]:
    """Moves with their stated angles [rad], without those of 0."""
    if len(angles_deg) != len(moves):
        times = ", ".join(f"{recording.time_s[move.start]:.0f}" for move in moves[:12])
        where = f" (at {times}{' ...' if len(moves) > 12 else ''} s)" if moves else ""
        raise InputError(
            f"{len(angles_deg)} turns were stated and {len(moves)} were found between poses of the same tilt{where}: "
            "give one angle in degrees for each, 0 to leave it out."
        )
    return [(move, math.radians(angle)) for move, angle in zip(moves, angles_deg, strict=True) if angle != 0.0]


def turns_on_faces(
    recording: Recording, segments: Segments, up: IntArray, angles_deg: Sequence[float] | None
) -> list[Turn]:
    """Turns about the axis of the case that points up; multiples of 90° where the user states no angles."""
    moves, axes = moves_on_faces(segments, up), np.eye(3)
    known = [(move, None) for move in moves] if angles_deg is None else _stated(recording, moves, angles_deg)
    faces = [int(up[move.pose_before]) for move, _ in known]
    return [
        Turn(move.start, move.stop, tuple((np.sign(face) * axes[abs(face) - 1]).tolist()), angle, face=face)
        for (move, angle), face in zip(known, faces, strict=True)
    ]


def stated_turns(
    recording: Recording,
    segments: Segments,
    accelerometer: SensorCalibration,
    gravity_m_s2: float,
    angles_deg: Sequence[float],
) -> list[Turn]:
    """The turns about the vertical by the angles that the user states, positive counter-clockwise seen from above.

    The axis of a turn is the table's normal in the body frame, by the centre of gravity's circle. Raises
    ``InputError`` when the numbers of turns and angles differ; the message states when each turn was found.
    """
    moves = moves_about_vertical(segments, accelerometer, gravity_m_s2)
    return [
        _turn(recording, segments, accelerometer, move, angle) for move, angle in _stated(recording, moves, angles_deg)
    ]


def resting_spans(segments: Segments) -> list[tuple[int, int]]:
    """Half-open ranges of the static poses: turns by 0°, which determine the bias."""
    return [(pose.start, pose.stop) for pose in segments.poses if pose.stop - pose.start >= 2]


def _turn(
    recording: Recording, segments: Segments, accelerometer: SensorCalibration, move: Move, angle_rad: float
) -> Turn:
    assert segments.accelerometer_mean is not None
    both = segments.accelerometer_mean[[move.pose_before, move.pose_after]]
    axis = (both @ accelerometer.S.T + accelerometer.b).mean(axis=0)
    sigma = TABLE_TILT_RAD * abs(math.cos(0.5 * angle_rad))
    circle = gravity_circle(recording, segments, move, angle_rad) if abs(angle_rad) > SEEN_TURN_RAD else None
    if circle is not None:
        seen = accelerometer.S @ circle.centre + accelerometer.b
        sigma_seen = math.sqrt(float(np.mean(accelerometer.S**2 @ circle.variance))) / float(np.linalg.norm(seen))
        if sigma_seen < max(sigma, 1e-4):
            axis, sigma = seen, sigma_seen
    x, y, z = (axis / np.linalg.norm(axis)).tolist()
    return Turn(move.start, move.stop, (x, y, z), angle_rad, sigma)


def shared_errors(turns: Sequence[Turn], accelerometer: SensorCalibration, gravity_m_s2: float) -> FloatArray:
    """(k, 3, 12) change of the turns [rad] by one standard error of each principal error of the accelerometer.

    All turns share these errors: unlike the noise of each circle they do not average out over turns there and back.
    """
    values, vectors = np.linalg.eigh(accelerometer.covariance)
    principal = vectors * np.sqrt(np.maximum(values, 0.0))
    out = np.empty((len(turns), 3, len(principal)))
    for k, turn in enumerate(turns):
        assert turn.angle_rad is not None
        axis = np.array(turn.direction)
        reading = np.linalg.solve(accelerometer.S, gravity_m_s2 * axis - accelerometer.b)
        jacobian = np.concatenate([np.kron(np.eye(3), reading), np.eye(3)], axis=1)
        out[k] = turn.angle_rad / gravity_m_s2 * (np.eye(3) - np.outer(axis, axis)) @ jacobian @ principal
    return out
