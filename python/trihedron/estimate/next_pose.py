"""Choice of the next pose: covariances predicted for each of 26 candidate poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.accelerometer.poses import CANDIDATES, design_rows
from trihedron.estimate.gyroscope.turn_design import rows_of_move
from trihedron.records import Calibration, Move, Recording, Segments
from trihedron.units import rate_to_si

NEAR = 0.9
"""Cosine to the previous pose above which a pose is not a candidate: the move would be too small."""

CORNER_PENALTY = 1.15
"""Factor on the cost of a pose on a corner, which is harder to hold still than one on a face or an edge."""

LONGEST_LOOK = 24

PRIOR = 0.1
"""Prior of a board before its first pose: scales within 10 %, axes within 0.1 rad, biases within 0.1 g."""


@dataclass(frozen=True, eq=False)
class Known:
    """Planned covariances, relative: accelerometer (9, 9) in the order of ``NAMES``, gyro (9, 9) row by row of S."""

    up: FloatArray
    accelerometer: FloatArray
    gyroscope: FloatArray | None
    pose_sigma: float
    move_sigma: float


def path_of(recording: Recording, segments: Segments, S: FloatArray | None, move: Move) -> FloatArray | None:
    """(k, 3) small rotation vectors of a move from the gyro, in the body, or None without a scale."""
    assert recording.gyroscope is not None
    start, stop = move.start, move.stop
    if S is None or stop - start < 4 or segments.gyroscope_mean is None:
        return None
    bias = 0.5 * (segments.gyroscope_mean[move.pose_before] + segments.gyroscope_mean[move.pose_after])
    rate = (recording.gyroscope[start:stop] - bias) @ S.T
    steps = np.diff(recording.time_s[start : stop + 1], append=recording.time_s[stop - 1])[: len(rate), None]
    pieces = np.array_split(np.nan_to_num(rate * steps), min(len(rate), 60))
    return np.array([piece.sum(axis=0) for piece in pieces])


def shortest_path(start: FloatArray, stop: FloatArray) -> FloatArray:
    """(1, 3) rotation vector of the body that moves up from ``start`` to ``stop``, both (3,) in the body."""
    # In the body, up rotates opposite to the body's own rotation.
    axis = np.cross(stop, start)
    if np.linalg.norm(axis) < 1e-9:
        axis = np.cross(start, np.eye(3)[int(np.argmin(np.abs(start)))])
    angle = float(np.arccos(np.clip(start @ stop, -1.0, 1.0)))
    return np.atleast_2d(axis * (angle / np.linalg.norm(axis)))


def sigma_of(known: Known) -> FloatArray:
    gyroscope = np.full(9, np.nan) if known.gyroscope is None else np.sqrt(np.diag(known.gyroscope))
    return np.concatenate([np.sqrt(np.diag(known.accelerometer)), gyroscope])


def _with_pose(known: Known, direction: FloatArray) -> Known:
    row = design_rows(direction[None, :])[0]
    accelerometer = _updated(known.accelerometer, row[None, :], known.pose_sigma)
    gyroscope = known.gyroscope
    if gyroscope is not None and len(known.up):
        rows = rows_of_move(shortest_path(known.up[-1], direction), direction)
        gyroscope = _updated(gyroscope, rows, known.move_sigma)
    up = np.vstack([known.up, direction[None, :]])
    return Known(up, accelerometer, gyroscope, known.pose_sigma, known.move_sigma)


def _updated(covariance: FloatArray, rows: FloatArray, sigma: float) -> FloatArray:
    seen = covariance @ rows.T
    gain = np.linalg.solve(rows @ seen + sigma**2 * np.eye(len(rows)), seen.T)
    return covariance - seen @ gain


def best_next(known: Known, wanted: FloatArray, factor: FloatArray) -> tuple[FloatArray, Known]:
    """The pose of 26 with the smallest remaining shortfall, reached by the shortest turn from the last pose."""
    best: tuple[float, FloatArray, Known] | None = None
    for direction in CANDIDATES:
        if len(known.up) and float(known.up[-1] @ direction) > NEAR:
            continue
        future = _with_pose(known, direction)
        relative = sigma_of(future) * factor / wanted
        # The largest ratio decides; the rms of all breaks ties, so that every pose improves something.
        cost = float(np.nanmax(relative)) + 0.3 * float(np.sqrt(np.nanmean(relative**2)))
        cost *= CORNER_PENALTY if np.all(np.abs(direction) > 0.3) else 1.0
        if best is None or cost < best[0]:
            best = (cost, direction, future)
    assert best is not None
    return best[1], best[2]


def poses_needed(known: Known, wanted: FloatArray, factor: FloatArray, shortfall: float) -> int | None:
    if shortfall <= 1.0:
        return 0
    for count in range(1, LONGEST_LOOK + 1):
        _, known = best_next(known, wanted, factor)
        if float(np.nanmax(sigma_of(known) * factor / wanted)) <= 1.0:
            return count
    return None


def is_determined(calibration: Calibration | None) -> bool:
    """Whether the poses determine all nine parameters of the accelerometer."""
    if calibration is None:
        return False
    observability = calibration.accelerometer.observability
    return observability is not None and observability.rank >= 9


def planned(
    recording: Recording,
    segments: Segments,
    calibration: Calibration | None,
    up: FloatArray,
    model: tuple[FloatArray, FloatArray, float],
) -> Known:
    """Planned covariances from the orientations of the poses, the paths of the moves and the noise; no fit needed."""
    centre, matrix, gravity = model
    relative = np.full(len(up), 1e-3)
    means = segments.accelerometer_mean
    if means is not None and segments.norm_sigma is not None and len(up):
        length = np.linalg.norm((means - centre) @ matrix.T, axis=1)
        size = gravity if is_determined(calibration) else float(np.median(length)) or 1.0
        relative = np.sqrt(np.mean((segments.norm_sigma @ np.abs(matrix).T) ** 2, axis=1)) / size
    relative = np.maximum(relative, 1e-6)
    rows = design_rows(up) / relative[:, None] if len(up) else np.zeros((0, 9))
    accelerometer = np.linalg.inv(rows.T @ rows + np.eye(9) / PRIOR**2)
    pose = float(np.median(relative)) if len(relative) else 1e-3
    if recording.gyroscope is None:
        return Known(up, accelerometer, None, pose, pose)
    scale = rate_to_si(recording.gyroscope_unit)
    S = None if scale is None else scale * np.eye(3)
    if calibration is not None and calibration.gyroscope is not None:
        S = calibration.gyroscope.S
    noise = 0.0
    if S is not None and segments.gyroscope_sigma is not None:
        step = 1.0 / recording.rate_hz
        noise = float(np.nanmean(np.abs(np.diag(S)) * segments.gyroscope_sigma)) * step * np.sqrt(2.0 / step)
    sigma = float(np.hypot(np.sqrt(2.0) * pose, 0.0 if not np.isfinite(noise) else noise))
    information = np.eye(9) / PRIOR**2
    for move in segments.moves:
        path = path_of(recording, segments, S, move)
        path = shortest_path(up[move.pose_before], up[move.pose_after]) if path is None else path
        design = rows_of_move(path, up[move.pose_after]) / sigma
        information += design.T @ design
    gyroscope: FloatArray = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return Known(up, accelerometer, gyroscope, pose, sigma)
