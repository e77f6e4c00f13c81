"""Poses for a joint model: cut at disturbances, and extended by poses that only drift."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.ranges import ranges_of
from trihedron.records import Move, Pose, Recording, Segments

SHORTEST_PIECE_S = 0.3
"""Least duration of a piece of a pose beside a disturbance; shorter ones are excluded."""


def resegment(recording: Recording, segments: Segments) -> Segments:
    """Poses for a model of the whole session: cut at disturbances, and extended by those that only drift.

    A disturbance inside a pose rotates the body; the mean over it contradicts the moves on both sides. Between the
    pieces of a cut pose the gyro carries the attitude like in any move.

    ``whole`` of the result are the poses as they were found, each averaged over all of its samples. Means are as they
    were read: a joint model names settling after rotations, and estimates it beside all other effects.
    """
    segments = segments if segments.as_read is None else segments.as_read
    shortest = max(int(SHORTEST_PIECE_S * recording.rate_hz), 8)
    spans: list[tuple[int, int, int]] = []
    was_disturbed = False
    for i, pose in enumerate(segments.poses):
        edges = [pose.start, *(k for cut in pose.disturbed if cut[1] > cut[0] for k in cut), pose.stop]
        was_disturbed |= len(edges) > 2
        kept = [(a, b, i) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= shortest]
        spans += kept or [(pose.start, pose.stop, i)]
    drifting = _drifting(recording, segments)
    merged = _in_pieces(recording, sorted([*spans, *((a, b, -1) for a, b in drifting)]))
    if len(merged) == segments.n_poses and not drifting and not was_disturbed:
        return segments
    return replace(_segments_of(recording, segments, merged), whole=averaged(recording, segments))


LONG_S = 1800.0
"""A longer pose is cut into pieces: its bias has time to drift, which one mean would hide."""
MOST_PIECES = 40


def _in_pieces(recording: Recording, spans: list[tuple[int, int, int]]) -> list[tuple[int, int, int]]:
    """Long poses cut into pieces, two samples apart, so that the moves between them are known to have no rotation."""
    rate = recording.rate_hz
    total_s = sum((b - a) / rate for a, b, _ in spans if (b - a) / rate > LONG_S)
    piece_s = max(LONG_S / 2.0, total_s / MOST_PIECES)
    out = []
    for a, b, source in spans:
        n = round((b - a) / rate / piece_s) if (b - a) / rate > LONG_S else 1
        edges = np.linspace(a, b, max(n, 1) + 1).astype(int)
        out += [(int(p), int(q) - (2 if q < b else 0), source) for p, q in pairwise(edges)]
    return out


def _drifting(recording: Recording, segments: Segments, block_s: float = 60.0) -> list[tuple[int, int]]:
    """Hours between poses in which only the readings drift: consecutive blocks that are as quiet as a pose."""
    if recording.accelerometer is None:
        return []
    assert segments.accelerometer_sigma is not None
    block = max(round(block_s * recording.rate_hz), 8)
    out: list[tuple[int, int]] = []
    for move in segments.moves:
        n = (move.stop - move.start) // block
        if n * block < LONG_S * recording.rate_hz:
            continue
        quiet = np.ones(n, dtype=bool)
        sigmas = (segments.accelerometer_sigma, segments.gyroscope_sigma)
        for values, sigma in zip((recording.accelerometer, recording.gyroscope), sigmas, strict=True):
            if values is None or sigma is None:
                continue
            steps = np.diff(values[move.start : move.start + n * block].reshape(n, block, 3), axis=1)
            quiet &= (np.nanvar(steps, axis=1) < 2.0 * 2.0 * sigma**2).all(axis=1)
        for first, last in ranges_of(quiet):
            start, stop = move.start + (first + 1) * block, move.start + (last - 1) * block
            if stop - start >= 0.5 * LONG_S * recording.rate_hz:
                out.append((start, stop))
    return out


def averaged(recording: Recording, segments: Segments) -> Segments:
    """The poses as they were found, averaged over all of their samples, with the disturbances seen in them."""
    spans = [(pose.start, pose.stop, i) for i, pose in enumerate(segments.poses)]
    out = _segments_of(recording, segments, spans)
    poses = tuple(replace(new, disturbed=old.disturbed) for new, old in zip(out.poses, segments.poses, strict=True))
    return replace(out, poses=poses)


def _segments_of(recording: Recording, segments: Segments, spans: list[tuple[int, int, int]]) -> Segments:
    old = segments.poses
    poses = tuple(
        Pose(k, a, b, a, b, is_unsteady=source < 0 or old[source].is_unsteady) for k, (a, b, source) in enumerate(spans)
    )
    moves = tuple(Move(k, k, k + 1, poses[k].stop, poses[k + 1].start) for k in range(len(poses) - 1))
    same = np.array([source >= 0 and b - a == old[source].stop - old[source].start for a, b, source in spans])
    means: dict[str, FloatArray | None] = {}
    for name in ("accelerometer", "gyroscope"):
        values, sigma = getattr(recording, name), getattr(segments, f"{name}_sigma")
        error = getattr(segments, f"{name}_sigma_mean")
        is_known = values is not None and sigma is not None and error is not None
        found = _means_of(values, sigma, error, segments.n_averaged, spans, same) if is_known else (None, None)
        means[f"{name}_mean"], means[f"{name}_sigma_mean"] = found
    t, sources = recording.time_s, np.array([source for _, _, source in spans])
    up, error_up = segments.accelerometer_up, segments.accelerometer_sigma_up
    return replace(
        segments, poses=poses, moves=moves, n_averaged=np.array([b - a for a, b, _ in spans]),
        time_mid_s=np.array([0.5 * (t[a] + t[b - 1]) for a, b, _ in spans]),
        duration_s=np.array([(b - a) / recording.rate_hz for a, b, _ in spans]),
        accelerometer_up=None if up is None else up[sources],
        accelerometer_sigma_up=None if error_up is None else np.where(same, error_up[sources], np.nan),
        **means,  # type: ignore[arg-type]
    )  # fmt: skip


def _means_of(
    values: FloatArray,
    sigma: FloatArray,
    old: FloatArray,
    n_averaged: IntArray,
    spans: list[tuple[int, int, int]],
    same: BoolArray,
) -> tuple[FloatArray, FloatArray]:
    """Means (n, 3) over ``spans`` and their errors: those known (``old``) where a span is the ``same`` as before."""
    mean = np.array([np.nanmean(values[a:b], axis=0) for a, b, _ in spans])
    error = np.zeros_like(mean)
    # Ratio of the old means' errors to white noise, for pieces of other durations.
    colour = np.median(old / (sigma / np.sqrt(np.maximum(n_averaged, 1))[:, None]), axis=0)
    for k, (a, b, source) in enumerate(spans):
        if same[k]:
            error[k] = old[source]
            continue
        part = values[a:b][np.isfinite(values[a:b]).all(axis=1)]
        blocks = np.array_split(part, 8) if len(part) >= 8 else [np.zeros((1, 3))] * 8
        scatter = np.std([block.mean(axis=0) for block in blocks], axis=0, ddof=1) / np.sqrt(8.0)
        floor = np.maximum(colour, 1.0) * sigma / np.sqrt(b - a)
        # Eight blocks detect a pose that goes on settling (several times the noise), not 20 % of its noise.
        error[k] = np.maximum(floor, scatter if source < 0 else np.where(scatter > 2.0 * floor, scatter, 0.0))
    return mean, error
