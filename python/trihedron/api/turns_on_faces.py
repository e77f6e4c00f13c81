"""Moves that begin and end on one face of the case: turns of method 1."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from trihedron.errors import RefusedError
from trihedron.estimate.accelerometer.whole_turns import OppositeHeadings, opposite_headings
from trihedron.estimate.gyroscope.turn_angles import Turn
from trihedron.records import Recording, Segments
from trihedron.records.segments import Move


def _moves_on_faces(segments: Segments, up: np.ndarray[tuple[int], np.dtype[np.int64]]) -> list[Move]:
    return [
        move
        for move in segments.moves
        if move.stop - move.start >= 2 and up[move.pose_before] == up[move.pose_after] != 0
    ]


def opposite_on_faces(
    recording: Recording,
    segments: Segments,
    up: np.ndarray[tuple[int], np.dtype[np.int64]],
    turns_deg: Sequence[float] | None,
) -> OppositeHeadings | None:
    """Raw readings half a turn from each pose, predicted from stated whole turns; None where turns do not match."""
    moves = _moves_on_faces(segments, up)
    if turns_deg is None or len(turns_deg) != len(moves):
        return None
    return opposite_headings(recording, segments, moves, [float(angle) for angle in turns_deg])


def turns_on_faces(
    segments: Segments, up: np.ndarray[tuple[int], np.dtype[np.int64]], turns_deg: Sequence[float] | None
) -> list[Turn]:
    """The moves that begin and end on the same face, as turns about the axis that points up."""
    moves = _moves_on_faces(segments, up)
    if turns_deg is None:
        return [Turn(move.start, move.stop, face=int(up[move.pose_before])) for move in moves]
    if len(turns_deg) != len(moves):
        raise RefusedError(
            f"{len(turns_deg)} turns were given and {len(moves)} were found between poses on the same face: "
            "give one angle in degrees for each, 0 to leave it out."
        )
    return [
        Turn(
            move.start,
            move.stop,
            abs(int(up[move.pose_before])) - 1,
            math.radians(angle) * np.sign(up[move.pose_before]),
            face=int(up[move.pose_before]),
        )
        for move, angle in zip(moves, turns_deg, strict=True)
        if angle != 0.0
    ]


def resting_spans(segments: Segments) -> list[tuple[int, int]]:
    """Half-open ranges of the static poses: turns by 0°, which determine the bias."""
    return [(pose.start, pose.stop) for pose in segments.poses if pose.stop - pose.start >= 2]
