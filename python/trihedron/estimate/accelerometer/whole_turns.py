"""Tilt of the table from whole turns on it: horizontal gravity rotates once through the case during a turn."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.estimate.gravity_circle import GravityCircle, gravity_circle
from trihedron.records.recording import Recording
from trihedron.records.segments import Move, Segments


@dataclass(frozen=True, eq=False)
class OppositeHeadings:
    """Raw readings (k, 3) predicted for the case half a turn from pose ``pose`` (k,), and covariances (k, 3, 3)."""

    values: FloatArray
    noise: FloatArray
    pose: IntArray


def opposite_headings(
    recording: Recording, segments: Segments, moves: list[Move], turns_deg: Sequence[float]
) -> OppositeHeadings | None:
    """Opposite headings of placements rotated by whole turns: half a turn further the case would read ``2 n̄ - ā``, with
    its reading ā at rest and the centre n̄ of gravity's circle over the turns; ``None`` without turns, or where the
    numbers of moves and angles differ."""
    mean = segments.accelerometer_mean
    if mean is None or segments.gyroscope_mean is None or len(turns_deg) != len(moves):
        return None
    found: dict[int, list[GravityCircle]] = {}
    last, placed = -1, -1
    for move, angle in zip(moves, turns_deg, strict=True):
        # Consecutive turns, without the case set down anew between them, belong to one placement.
        placed = placed if move.pose_before == last else move.pose_before
        last = move.pose_after
        is_whole = angle != 0.0 and angle % 360.0 == 0.0
        circle = gravity_circle(recording, segments, move, np.radians(angle)) if is_whole else None
        if circle is not None:
            found.setdefault(placed, []).append(circle)
    if not found:
        return None
    poses = np.array(list(found), dtype=np.int64)
    centre = np.array([np.mean([one.centre for one in found[k]], axis=0) for k in poses.tolist()])
    # The unevenness of the table is common to the turns of one placement: their errors do not average out.
    variance = np.array([np.mean([one.variance for one in found[k]], axis=0) for k in poses.tolist()])
    # With this noise the mean of both headings, n̄, has at least the variance of the circle's centre.
    return OppositeHeadings(2.0 * centre - mean[poses], 4.0 * variance[:, :, None] * np.eye(3), poses)


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
