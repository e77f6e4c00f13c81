"""Gravity during a turn about a table's normal: a circle in the body frame, whose centre is along the normal."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron._core import integrate_raw_rate
from trihedron.arrays import FloatArray, IntArray
from trihedron.records import Move, Recording, Segments

BLOCK_S = 0.1
"""Longest blocks of force and angle: short against a turn, long against the correlation of filtered readings."""
BLOCKS = 60
"""Fewest blocks of a turn: six for each cosine and sine."""
HARMONICS = (2, 3, 4, 5)
"""Harmonics of whole turns without a tilt signal: vibration, shocks and an uneven table excite them like the first."""


Circle = tuple[FloatArray, FloatArray]
"""Mean raw reading (3,) over the circle of gravity during a turn, and its variance (3,)."""


def gravity_circle(recording: Recording, segments: Segments, move: Move, angle_rad: float) -> Circle | None:
    """The circle of a turn by ``angle_rad``, over it and the poses on both sides; ``None`` for too short a turn.

    As the body turns by θ: ``a(t) = n̄ + c cos θ + s sin θ + p θ'² + q θ''`` (p, q for a sensor off the axis), whatever
    the accelerometer's S and b.
    """
    assert recording.accelerometer is not None
    assert recording.gyroscope is not None
    assert segments.gyroscope_mean is not None
    length = min(round(BLOCK_S * recording.rate_hz), (move.stop - move.start) // BLOCKS)
    if length < 1:
        return None
    start, stop = segments.poses[move.pose_before].start, segments.poses[move.pose_after].stop
    cuts = np.arange(start, stop - length, length)
    edges = np.stack([cuts, np.minimum(cuts + length + 1, stop)], axis=1).astype(np.int64)
    raw, duration = integrate_raw_rate(recording.time_s, recording.gyroscope, edges, 1)
    bias = segments.gyroscope_mean[[move.pose_before, move.pose_after]].mean(axis=0)
    turned = np.asarray(raw) - np.outer(duration, bias)
    # θ(t) is the gyro's integral, scaled to the stated angle.
    inside = (cuts >= move.start - length) & (cuts < move.stop)
    whole = turned[inside].sum(axis=0)
    along = np.where(inside, turned @ whole / float(whole @ whole), 0.0) * angle_rad
    force = np.array([np.mean(recording.accelerometer[a:b], axis=0) for a, b in edges])
    known = np.isfinite(force).all(axis=1) & np.isfinite(along)
    return _fitted(force[known], np.cumsum(along[known]) - 0.5 * along[known], (along / duration)[known], angle_rad)


def _fitted(force: FloatArray, theta: FloatArray, speed: FloatArray, angle_rad: float) -> Circle | None:
    harmonics = HARMONICS if abs(angle_rad) > 2.0 * np.pi - 1e-6 else ()
    design = np.column_stack(
        [np.ones(len(theta)), np.cos(theta), np.sin(theta), speed**2, np.gradient(speed)]
        + [f(k * theta) - f(0.0) for k in harmonics for f in (np.cos, np.sin)]
    )
    size = np.linalg.norm(design, axis=0)
    design = design / size
    solution, _, rank, _ = np.linalg.lstsq(design, force, rcond=None)
    if rank < design.shape[1]:
        return None
    inverse = np.diag(np.linalg.inv(design.T @ design))
    variance = np.sum((force - design @ solution) ** 2, axis=0) / (len(force) - design.shape[1])
    if harmonics:
        # Disturbance power in harmonics 2 to 5, per unit variance of each coefficient, estimates that of the centre.
        others = slice(-2 * len(harmonics), None)
        variance = np.maximum(variance, np.mean(solution[others] ** 2 / inverse[others, None], axis=0))
    return solution[0] / size[0], variance * inverse[0] / size[0] ** 2


# Tilt of the table from whole turns on it: horizontal gravity rotates once through the case during a turn.


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
    found: dict[int, list[Circle]] = {}
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
    # The unevenness of the table is common to the turns of one placement: their errors do not average out.
    centre, variance = np.array([np.mean(circles, axis=0) for circles in found.values()]).transpose(1, 0, 2)
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
