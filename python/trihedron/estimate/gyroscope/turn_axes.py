"""Known turns on a table with the sensor in any pose: their axes in the body frame from the accelerometer."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from trihedron._core import integrate_raw_rate
from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.gyroscope.turn_angles import Turn
from trihedron.records.calibration import SensorCalibration
from trihedron.records.recording import Recording
from trihedron.records.segments import Move, Segments

SAME_POSE_RAD = math.radians(5.0)
"""Largest change of gravity's direction in a turn on a table: twice the table's tilt, which is two degrees at most."""
TABLE_TILT_RAD = math.radians(1.0)
"""Standard uncertainty of the table's tilt where a turn does not show it: rooms and tables are built to half of it."""
BLOCK_S = 0.1
"""Blocks of force and angle for the axis: short against a turn, long against the correlation of filtered readings."""
SEEN_TURN_RAD = math.radians(60.0)
"""Smallest turn whose axis is fitted: gravity must cover enough of its circle in the body frame."""


def turns_about_vertical(segments: Segments, accelerometer: SensorCalibration, gravity_m_s2: float) -> list[Move]:
    """Moves that do not change gravity's direction (within ``SAME_POSE_RAD``): turns on a table by any angle."""
    assert segments.accelerometer_mean is not None
    force = segments.accelerometer_mean @ accelerometer.S.T + accelerometer.b
    limit = 2.0 * gravity_m_s2 * math.sin(0.5 * SAME_POSE_RAD)
    return [
        move
        for move in segments.moves
        if move.stop - move.start >= 2
        and float(np.linalg.norm(force[move.pose_after] - force[move.pose_before])) < limit
    ]


def stated_turns(
    recording: Recording,
    segments: Segments,
    accelerometer: SensorCalibration,
    gravity_m_s2: float,
    angles_deg: Sequence[float],
) -> list[Turn]:
    """The turns about the vertical by the angles that the user states, positive counter-clockwise seen from above.

    The axis of a turn is the table's normal in the body frame. As the body turns by θ, gravity moves on a circle about
    it: ``f(t) = n̄ + c cos θ + s sin θ + k θ'²`` (k for a sensor off the axis), fitted over the turn and the poses on
    both sides; ``n̄`` is the axis. Raises ``RefusedError`` when the numbers of turns and angles differ; the message
    states when each turn was found.
    """
    moves = turns_about_vertical(segments, accelerometer, gravity_m_s2)
    if len(angles_deg) != len(moves):
        times = ", ".join(f"{recording.time_s[move.start]:.0f}" for move in moves[:12])
        where = f" (at {times}{' ...' if len(moves) > 12 else ''} s)" if moves else ""
        raise RefusedError(
            f"{len(angles_deg)} turns were stated and {len(moves)} were found between poses of the same tilt{where}: "
            "give one angle in degrees for each, 0 to leave it out."
        )
    return [
        _turn(recording, segments, accelerometer, move, math.radians(angle))
        for move, angle in zip(moves, angles_deg, strict=True)
        if angle != 0.0
    ]


def _turn(
    recording: Recording, segments: Segments, accelerometer: SensorCalibration, move: Move, angle_rad: float
) -> Turn:
    assert segments.accelerometer_mean is not None
    both = segments.accelerometer_mean[[move.pose_before, move.pose_after]]
    force = both @ accelerometer.S.T + accelerometer.b
    axis = force.sum(axis=0)
    sigma = TABLE_TILT_RAD * abs(math.cos(0.5 * angle_rad))
    if abs(angle_rad) > SEEN_TURN_RAD:
        seen, sigma_seen = axis_of_turn(recording, segments, accelerometer, move, angle_rad)
        if sigma_seen < max(sigma, 1e-4):
            axis, sigma = seen, sigma_seen
    x, y, z = (float(v) for v in axis / np.linalg.norm(axis))
    return Turn(move.start, move.stop, None, angle_rad, (x, y, z), sigma)


def shared_errors(turns: Sequence[Turn], accelerometer: SensorCalibration, gravity_m_s2: float) -> FloatArray:
    """(k, 3, 12) change of the turns [rad] by one standard error of each principal error of the accelerometer.

    All turns share these errors: unlike the noise of each circle they do not average out over turns there and back.
    """
    values, vectors = np.linalg.eigh(accelerometer.covariance)
    principal = vectors * np.sqrt(np.maximum(values, 0.0))
    out = np.empty((len(turns), 3, len(principal)))
    for k, turn in enumerate(turns):
        assert turn.direction is not None
        assert turn.angle_rad is not None
        axis = np.array(turn.direction)
        reading = np.linalg.solve(accelerometer.S, gravity_m_s2 * axis - accelerometer.b)
        jacobian = np.concatenate([np.kron(np.eye(3), reading), np.eye(3)], axis=1)
        out[k] = turn.angle_rad / gravity_m_s2 * (np.eye(3) - np.outer(axis, axis)) @ jacobian @ principal
    return out


def axis_of_turn(
    recording: Recording, segments: Segments, accelerometer: SensorCalibration, move: Move, angle_rad: float
) -> tuple[FloatArray, float]:
    """Mean force (3,) over the circle of a turn by ``angle_rad``, and the standard error [rad] of its direction."""
    assert recording.accelerometer is not None
    assert recording.gyroscope is not None
    before, after = segments.poses[move.pose_before], segments.poses[move.pose_after]
    start, stop = before.start, after.stop
    length = max(1, round(BLOCK_S * recording.rate_hz))
    cuts = np.arange(start, stop - length, length)
    edges = np.stack([cuts, np.minimum(cuts + length + 1, stop)], axis=1).astype(np.int64)
    raw, duration = integrate_raw_rate(recording.time_s, recording.gyroscope, edges, 1)
    assert segments.gyroscope_mean is not None
    bias = segments.gyroscope_mean[[move.pose_before, move.pose_after]].mean(axis=0)
    turned = np.asarray(raw) - np.outer(duration, bias)
    # θ(t) is the gyro's integral, scaled to the stated angle.
    inside = (cuts >= move.start - length) & (cuts < move.stop)
    whole = turned[inside].sum(axis=0)
    along = np.where(inside, turned @ whole / float(whole @ whole), 0.0) * angle_rad
    theta = np.cumsum(along) - 0.5 * along
    speed = along / np.asarray(duration)
    force = np.array([np.nanmean(recording.accelerometer[a:b], axis=0) for a, b in edges])
    force = force @ accelerometer.S.T + accelerometer.b
    design = np.column_stack([np.ones(len(cuts)), np.cos(theta), np.sin(theta), speed**2])
    keep = np.isfinite(force).all(axis=1)
    design, force = design[keep], force[keep]
    size = np.linalg.norm(design, axis=0)
    solution, *_ = np.linalg.lstsq(design / size, force, rcond=None)
    rest = force - design / size @ solution
    freedom = max(len(rest) - 4, 1)
    inverse = np.linalg.pinv((design / size).T @ (design / size))
    variance = float(np.sum(rest**2)) / (3.0 * freedom) * inverse[0, 0] / size[0] ** 2
    mean = solution[0] / size[0]
    return mean, math.sqrt(variance) / float(np.linalg.norm(mean))
