"""Tilt of the table from whole turns on it: horizontal gravity rotates once through the case during a turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.records.recording import Recording
from trihedron.records.segments import Move, Segments

HARMONICS = (2, 3, 4, 5)
"""Harmonics of the turn without a tilt signal: vibration, shocks and an uneven table excite them like the first."""
FEWEST = 60
"""Fewest samples of a turn: six for each of the ten cosines and sines."""


@dataclass(frozen=True, eq=False)
class OppositeHeadings:
    """Raw readings (k, 3) predicted for the case half a turn from pose ``pose`` (k,), and covariances (k, 3, 3)."""

    values: FloatArray
    noise: FloatArray
    pose: IntArray


def opposite_headings(
    recording: Recording, segments: Segments, moves: list[Move], turns_deg: list[float]
) -> OppositeHeadings | None:
    """Opposite headings of placements rotated by whole turns, from the first harmonic of the readings over the turns.

    With reading a, its mean ā at rest and angle φ, ``a - ā = c + A (cos φ - 1) + B sin φ + P ω² + Q ω'``: P and Q are
    due to the sensor's distance from the axis. Half a turn further the case would read ā - 2A (``None`` without turns).
    """
    force, gyro = recording.accelerometer, recording.gyroscope
    mean, sigma = segments.accelerometer_mean, segments.accelerometer_sigma_mean
    if force is None or gyro is None or mean is None or sigma is None or segments.gyroscope_mean is None:
        return None
    found: dict[int, list[tuple[FloatArray, FloatArray]]] = {}
    last, placed = -1, -1
    for move, angle in zip(moves, turns_deg, strict=True):
        # Consecutive turns, without the case set down anew between them, belong to one placement.
        placed = placed if move.pose_before == last else move.pose_before
        last = move.pose_after
        if angle == 0.0 or angle % 360.0 != 0.0 or move.stop - move.start < FEWEST:
            continue
        rows = slice(move.start, move.stop)
        bias = 0.5 * (segments.gyroscope_mean[move.pose_before] + segments.gyroscope_mean[move.pose_after])
        rest = 0.5 * (mean[move.pose_before] + mean[move.pose_after])
        one = _first_harmonic(recording.time_s[rows], force[rows] - rest, gyro[rows] - bias, np.radians(angle))
        if one is not None:
            found.setdefault(placed, []).append(one)
    if not found:
        return None
    poses = np.array(list(found), dtype=np.int64)
    lean = np.array([np.mean([a for a, _ in found[k]], axis=0) for k in poses.tolist()])
    # The unevenness of the table is common to the turns of one placement: their errors do not average out.
    variance = np.array([np.mean([v for _, v in found[k]], axis=0) for k in poses.tolist()])
    at_rest = np.asarray(sigma)[poses] ** 2
    # ā enters both headings: with this noise their mean, ā - A, has variance σ_ā² + σ_A².
    noise = 3.0 * at_rest + 4.0 * variance
    return OppositeHeadings(mean[poses] - 2.0 * lean, np.einsum("ni,ij->nij", noise, np.eye(3)), poses)


def _first_harmonic(
    time_s: FloatArray, force: FloatArray, rate: FloatArray, angle_rad: float
) -> tuple[FloatArray, FloatArray] | None:
    """A (3,), raw, and its variance (3,), from readings (n, 3) of a turn less those at rest; ``None`` if singular."""
    if not (np.isfinite(force).all() and np.isfinite(rate).all()):
        return None
    step = np.diff(time_s)
    about = rate[:, int(np.argmax(np.abs(rate.sum(axis=0))))]
    turned = np.concatenate([[0.0], np.cumsum(0.5 * step * (about[1:] + about[:-1]))])
    if turned[-1] == 0.0:
        return None
    phase = turned / turned[-1] * angle_rad
    speed = np.gradient(phase, time_s)
    design = np.column_stack(
        [np.cos(phase) - 1.0, np.ones(len(phase)), np.sin(phase), speed**2, np.gradient(speed, time_s)]
        + [f(k * phase) for k in HARMONICS for f in (np.cos, np.sin)]
    )
    design = design / np.linalg.norm(design, axis=0)
    size = np.linalg.norm(np.cos(phase) - 1.0)
    solution, _, rank, _ = np.linalg.lstsq(design, force, rcond=None)
    if rank < design.shape[1]:
        return None
    inverse = np.linalg.inv(design.T @ design)
    # Disturbance power in harmonics 2 to 5, per unit variance of each coefficient, estimates the disturbance of A.
    others = np.arange(design.shape[1] - 2 * len(HARMONICS), design.shape[1])
    heard = np.mean(solution[others] ** 2 / np.diag(inverse)[others, None], axis=0)
    left = force - design @ solution
    white = np.sum(left**2, axis=0) / (len(force) - design.shape[1])
    lean, variance = solution[0] / size, np.maximum(heard, white) * inverse[0, 0] / size**2
    return lean, variance


def with_opposite(
    values: FloatArray, noise: FloatArray, faces: IntArray, opposite: OppositeHeadings | None
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Poses that are faces (``faces`` not 0), each followed by the opposite heading from its turns."""
    used = np.flatnonzero(faces)
    if opposite is None:
        return values[used], noise[used], faces[used]
    at = np.searchsorted(used, opposite.pose, side="right")
    return (
        np.insert(values[used], at, opposite.values, axis=0),
        np.insert(noise[used], at, opposite.noise, axis=0),
        np.insert(faces[used], at, faces[opposite.pose]),
    )
