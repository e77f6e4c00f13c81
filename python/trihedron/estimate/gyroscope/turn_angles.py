"""Turns as measured, and the angles that are stated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron._core import block_differences, integrate_raw_rate
from trihedron.arrays import TINY, BoolArray, FloatArray
from trihedron.errors import InputError
from trihedron.estimate.gyroscope.biases import pool_biases
from trihedron.estimate.gyroscope.measurements import BLOCK_S
from trihedron.estimate.gyroscope.turn_rounding import hidden_angles
from trihedron.records import Move, Recording, Segments

MIN_SPREAD = 0.2
"""Smallest singular value of unit turn axes that determine all of S: three axes within some 10° of one plane have
less."""


@dataclass(frozen=True, eq=False)
class MeasuredTurns:
    """``raw_angle`` (k, 3) = ∫w' dt and ``duration_s`` (k,) of the turns, the ``bias`` (3,) at rest, and their noise.

    ``var_rate`` (3,) is ``N²`` in raw unit² · s, ``bias_spread`` (3,) the variance of the true bias between intervals
    without rotation. ``hidden`` (k, 3, m) are errors by rounding.
    """

    raw_angle: FloatArray
    duration_s: FloatArray
    bias: FloatArray
    var_rate: FloatArray
    bias_spread: FloatArray
    hidden: FloatArray

    def of(self, used: BoolArray) -> MeasuredTurns:
        """The turns ``used`` (k,)."""
        of_turns = self.raw_angle[used], self.duration_s[used]
        return MeasuredTurns(*of_turns, self.bias, self.var_rate, self.bias_spread, self.hidden[used])

    def turned(self) -> FloatArray:
        """(k, 3) raw angles less those of the bias."""
        return self.raw_angle - np.outer(self.duration_s, self.bias)


def measure_turns(recording: Recording, turns: Sequence[Move], static: Sequence[tuple[int, int]]) -> MeasuredTurns:
    """Integrate turns and static intervals; the noise is measured in the static intervals.

    Raises ``InputError`` when the static intervals are too short to measure the noise.
    """
    assert recording.gyroscope is not None
    gyroscope, step_s, quantum = recording.gyroscope, 1.0 / recording.rate_hz, recording.facts.of("gyroscope").step
    edges = np.array([[turn.start, turn.stop] for turn in turns], dtype=np.int64).reshape(-1, 2)
    raw_angle, duration = integrate_raw_rate(recording.time_s, gyroscope, edges, 3)
    static_edges = np.array(static, dtype=np.int64)
    static_angle, static_duration = integrate_raw_rate(recording.time_s, gyroscope, static_edges, 1)
    squares, count = block_differences(
        gyroscope, static_edges, np.arange(len(static_edges)), max(1, round(BLOCK_S / step_s))
    )
    if count < 4:
        raise InputError(
            "the stretches without rotation are too short to measure the gyro's noise: keep still for some seconds"
        )
    # At least the variance of rounding, which also covers codes that a turn passes through.
    var_rate = np.maximum(np.array(squares) / count, quantum**2 / 12.0) * step_s
    static_s = np.array(static_duration)[:, None]
    bias, _, spread = pool_biases(static_angle / static_s, var_rate / static_s)
    hidden = hidden_angles(gyroscope, step_s, quantum, edges, static_edges, raw_angle)
    return MeasuredTurns(raw_angle, np.array(duration), bias, var_rate, spread, hidden)


def other_sense(is_reversed: BoolArray, angles: FloatArray) -> InputError:
    """The error for turns by stated ``angles`` (k,) [rad] some of which the gyro shows to be ``is_reversed`` (k,)."""
    said = ",".join(f"{math.degrees(angle):g}" for angle in np.where(is_reversed, -angles, angles))
    numbers = ", ".join(str(k + 1) for k in np.flatnonzero(is_reversed))
    return InputError(
        f"the gyro turned the other way in turn {numbers} than the stated angles say: as it read them they are "
        f"--turns {said}"
    )


def scale_of_stated(raw: FloatArray, angles: FloatArray) -> FloatArray | None:
    """Scale (3, 3), rad/s per raw unit, by a robust fit to raw angles (k, 3) of turns by ``angles`` (k, 3) [rad];
    ``None`` where they do not span three axes.

    Least absolute deviations (reweighted least squares) of ``φ'_i - z̄ Δt_i = S_w φ_i``.
    """
    size: FloatArray = np.linalg.norm(angles, axis=1)
    if not spans_three_axes(angles / size[:, None]):
        return None
    # Initial weights are equal in relative error; later ones are the inverse of the relative misfit.
    weight: FloatArray = 1.0 / size
    for _ in range(30):
        solution, *_ = np.linalg.lstsq(angles * weight[:, None], raw * weight[:, None], rcond=None)
        miss = np.linalg.norm(raw - angles @ solution, axis=1) / size
        weight = 1.0 / (size * np.sqrt(np.maximum(miss, 1e-6 * max(float(miss.max()), TINY))))
    if np.linalg.cond(solution) > 1.0 / MIN_SPREAD:
        return None
    return np.asarray(np.linalg.inv(solution.T), dtype=np.float64)


def spans_three_axes(directions: FloatArray) -> bool:
    """Whether unit vectors (k, 3) along turns determine all of S."""
    return len(directions) >= 3 and bool(np.linalg.svd(directions, compute_uv=False)[-1] >= MIN_SPREAD)


def stated(recording: Recording, moves: list[Move], angles_deg: Sequence[float]) -> list[tuple[int, Move, float]]:
    """Moves with their numbers, from one, and their stated angles [rad], without those of 0.

    Raises ``InputError`` when the numbers of turns and angles differ; the message states when each turn was found.
    """
    if len(angles_deg) != len(moves):
        times = ", ".join(f"{recording.time_s[move.start]:.0f}" for move in moves[:12])
        where = f" (at {times}{' ...' if len(moves) > 12 else ''} s)" if moves else ""
        raise InputError(
            f"{len(angles_deg)} turns were stated and {len(moves)} were found between poses of the same tilt{where}: "
            "give one angle in degrees for each, 0 to leave it out."
        )
    if not np.all(np.isfinite(angles_deg)):
        raise InputError("the angle of a turn must be finite")
    every = enumerate(zip(moves, angles_deg, strict=True), start=1)
    return [(k, move, math.radians(angle)) for k, (move, angle) in every if angle != 0.0]


def resting_spans(segments: Segments) -> list[tuple[int, int]]:
    """Half-open ranges of the static poses: turns by 0°, which determine the bias."""
    return [(pose.start, pose.stop) for pose in segments.poses if pose.stop - pose.start >= 2]
