"""Turns as measured, and identification of the known angle and case axis of each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron._core import block_differences, integrate_raw_rate
from trihedron.arrays import TINY, BoolArray, FloatArray, IntArray
from trihedron.errors import InputError
from trihedron.estimate.gyroscope.biases import pool_biases
from trihedron.estimate.gyroscope.measurements import BLOCK_S
from trihedron.estimate.gyroscope.turn_rounding import hidden_angles
from trihedron.estimate.session.start import scale_matrix
from trihedron.records import Move, Recording, Segments
from trihedron.units import rate_to_si

QUARTER = math.pi / 2.0

SCALE_TOLERANCE = 0.05
"""Relative tolerance of a nominal scale: data sheets state 1 to 3 %."""

MIN_SPREAD = 0.2
"""Smallest singular value of unit turn axes that determine all of S: three axes within some 10° of one plane have
less."""

SLACK_RAD = math.radians(10.0)
"""A turn further than this from every multiple of 90° was not made against a wall."""


@dataclass(frozen=True)
class Turn:
    """Samples ``[start, stop)`` of a turn about the axis of the case that points up, ``face`` (±1, ±2, ±3).

    ``angle_rad`` is its signed angle where known; ``number`` its place, from one, among all turns that were found.
    """

    start: int
    stop: int
    face: int
    angle_rad: float | None = None
    number: int = 0

    @property
    def axis(self) -> int:
        """Axis of the case: 0, 1 or 2."""
        return abs(self.face) - 1

    @property
    def direction(self) -> FloatArray:
        """Unit vector (3,) along the turn, in the body frame."""
        return np.asarray(math.copysign(1.0, self.face) * np.eye(3)[self.axis])


@dataclass(frozen=True)
class KnownTurn:
    """A turn with its known ``angle_rad``; ``is_used`` is false when the readings contradict it.

    ``seen_rad`` is the angle by the nominal scale, ``off_axis_rad`` the angle between its axis and the turn's.
    ``is_ambiguous``: the scale is too uncertain to identify the multiple of 90°.
    """

    turn: Turn
    angle_rad: float
    is_used: bool
    seen_rad: float
    off_axis_rad: float
    is_ambiguous: bool = False


@dataclass(frozen=True, eq=False)
class MeasuredTurns:
    """``raw_angle`` (k, 3) = ∫w' dt and ``duration_s`` (k,) of the turns, the ``bias`` (3,) at rest, and their noise.

    ``var_rate`` (3,) is ``N²`` in raw unit² · s, ``var_bias`` (3,) that of the bias; ``bias_spread`` (3,) the variance
    of the true bias between intervals without rotation, whose rates are ``static_rates`` (z, 3), ``bias_excess`` (3,)
    χ² of its constancy. ``hidden`` (k + 1, 3, m) are errors by rounding, of the turns and of the bias.
    """

    raw_angle: FloatArray
    duration_s: FloatArray
    bias: FloatArray
    var_rate: FloatArray
    var_bias: FloatArray
    bias_spread: FloatArray
    bias_excess: FloatArray
    static_rates: FloatArray
    hidden: FloatArray

    def turned(self) -> FloatArray:
        """(k, 3) raw angles less those of the bias."""
        return self.raw_angle - np.outer(self.duration_s, self.bias)


def measure_turns(
    recording: Recording, turns: Sequence[Turn] | Sequence[Move], static: Sequence[tuple[int, int]]
) -> MeasuredTurns:
    """Integrate turns and static intervals; the noise is measured in the static intervals.

    Raises ``InputError`` when there is no gyro, no turn, or no static interval, or these are too short to measure the
    noise.
    """
    if recording.gyroscope is None:
        raise InputError("the recording has no gyroscope")
    if not turns:
        raise InputError("--method faces needs turns: none were given and none were found")
    if not static:
        raise InputError("--method faces needs a stretch without rotation: keep the sensor still for some seconds")
    gyroscope, step_s, quantum = recording.gyroscope, 1.0 / recording.rate_hz, recording.facts.of("gyroscope").step
    edges = np.array([[turn.start, turn.stop] for turn in turns], dtype=np.int64)
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
    static_rates = static_angle / static_s
    bias, excess, spread = pool_biases(static_rates, var_rate / static_s)
    var_bias = 1.0 / np.sum(1.0 / np.maximum(var_rate / static_s + spread, TINY), axis=0)
    hidden = hidden_angles(gyroscope, step_s, quantum, edges, static_edges, raw_angle)
    return MeasuredTurns(raw_angle, np.array(duration), bias, var_rate, var_bias, spread, excess, static_rates, hidden)


class TurnAngleUnknownError(InputError):
    """Readings are counts, and neither the angles of the turns nor a scale are known: the question to the user."""

    def __init__(self) -> None:
        super().__init__(
            "the readings are counts, and turns of 90, 180 or 360° differ by their scale alone: was each turn 90, 180 "
            "or 360°? Say --turns 90,-90,... (one angle a turn, 0 leaves it out), or the nominal scale "
            "(--gyro-nominal, rad/s per count)"
        )


def nominal_matrix(
    recording: Recording, measured: MeasuredTurns, turns: Sequence[Turn], nominal_scale: FloatArray | float | None
) -> FloatArray:
    """Nominal scale (3, 3), rad/s per raw unit: from stated turns, else as given, else from the unit.

    Stated turns have precedence. Turns of unknown size determine no scale: any divisor of their angles would fit.
    Raises ``InputError`` with the question to the user, when readings are counts and neither angles nor a scale are
    known.
    """
    is_stated = np.array([bool(turn.angle_rad) for turn in turns])
    angles = np.array([(turn.angle_rad or 0.0) * turn.direction for turn in turns])[is_stated]
    raw = measured.turned()[is_stated]
    stated = scale_of_stated(raw, angles)
    if stated is not None:
        return stated
    # Readings of turns about one axis have one sign relative to the turns.
    first = [int(np.flatnonzero(np.any(angles * one != 0.0, axis=1))[0]) for one in angles]
    is_reversed = np.sum(angles * angles[first], axis=1) * np.sum(raw * raw[first], axis=1) < 0.0
    if np.any(is_reversed):
        raise other_sense(is_reversed, np.array([turn.angle_rad for turn in turns if turn.angle_rad]))
    if nominal_scale is not None:
        return scale_matrix(nominal_scale)
    unit = rate_to_si(recording.gyroscope_unit)
    if unit is not None:
        return unit * np.eye(3)
    raise TurnAngleUnknownError


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


def identify_turns(
    measured: MeasuredTurns, turns: Sequence[Turn], nominal: FloatArray, tolerance: float = SCALE_TOLERANCE
) -> list[KnownTurn]:
    """Nearest multiple of 90° for every turn without a stated angle.

    Small turns are identified first: each refines the scale for the next larger one, so that eight whole turns are
    identified although the nominal scale has the relative error ``tolerance``.
    """
    seen = measured.turned() @ nominal.T
    sums = np.zeros((3, 2))
    known: dict[int, KnownTurn] = {}
    for index in np.argsort(np.linalg.norm(seen, axis=1), kind="stable").tolist():
        turn, vector, of_axis = turns[index], seen[index], sums[turns[index].axis]
        unit = turn.direction
        is_first = of_axis[1] == 0.0
        along = float(vector @ unit) if is_first else float(vector @ unit) / (of_axis[0] / of_axis[1])
        known[index] = one = _identified(turn, vector, along, tolerance if is_first else 0.1 * tolerance)
        if one.is_used:
            of_axis += (float(vector @ unit) * one.angle_rad, one.angle_rad**2)
    return [known[index] for index in range(len(turns))]


def _identified(turn: Turn, seen: FloatArray, along: float, tolerance: float) -> KnownTurn:
    """A turn seen as (3,) with the nominal scale, by ``along`` [rad] with the one refined to ``tolerance``."""
    unit = turn.direction
    off_axis = math.atan2(float(np.linalg.norm(np.cross(seen, unit))), abs(float(seen @ unit)))
    if turn.angle_rad is None:
        angle, unsure = QUARTER * round(along / QUARTER), abs(along) * tolerance
        # A turn is identified only if the scale's uncertainty is below half of 90°.
        is_ambiguous = unsure >= 0.5 * QUARTER
        limit = 0.0 if is_ambiguous else SLACK_RAD + min(unsure, 0.2 * QUARTER)
    else:
        angle, is_ambiguous = turn.angle_rad, False
        limit = max(SLACK_RAD, 0.3 * abs(angle))
    is_used = angle != 0.0 and abs(along - angle) < limit and off_axis < 2.0 * SLACK_RAD
    return KnownTurn(turn, float(angle), is_used, along, off_axis, is_ambiguous)


# Turns on a table, among the moves of a log.


def moves_on_faces(segments: Segments, up: IntArray) -> list[Move]:
    """Moves that begin and end on one face of the case, ``up`` (n,) in every pose (0: none)."""
    moves = (move for move in segments.moves if move.stop - move.start >= 2)
    return [one for one in moves if up[one.pose_before] == up[one.pose_after] != 0]


def turns_on_faces(
    recording: Recording, segments: Segments, up: IntArray, angles_deg: Sequence[float] | None
) -> list[Turn]:
    """Turns about the axis of the case that points up; multiples of 90° where the user states no angles."""
    moves = moves_on_faces(segments, up)
    every = enumerate(moves, start=1)
    known = [(k, move, None) for k, move in every] if angles_deg is None else stated(recording, moves, angles_deg)
    return [Turn(move.start, move.stop, int(up[move.pose_before]), angle, k) for k, move, angle in known]


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
