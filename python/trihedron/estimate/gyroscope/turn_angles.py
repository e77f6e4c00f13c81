"""Turns as measured, and identification of the known angle and case axis of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron._core import integrate_raw_rate
from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.gyroscope.biases import pool_biases
from trihedron.estimate.gyroscope.measurements import BLOCK_S
from trihedron.estimate.gyroscope.turn_rounding import HiddenAngles, hidden_angles
from trihedron.records.recording import Recording
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
    """Samples ``[start, stop)`` of a turn; ``axis`` 0, 1, 2 of the case and the signed ``angle_rad`` where known.

    ``direction`` (3,) is the unit axis in the body frame where it is no axis of the case, ``sigma_direction_rad`` the
    standard error of each of its two components. ``face`` (±1, ±2, ±3) is the axis of the case that points up, 0 where
    unknown: a face that is not flat tilts all turns on it equally.
    """

    start: int
    stop: int
    axis: int | None = None
    angle_rad: float | None = None
    direction: tuple[float, float, float] | None = None
    sigma_direction_rad: float = 0.0
    face: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.start < self.stop - 1:
            raise RefusedError(f"a turn must hold at least two samples, got {self.start}..{self.stop}")
        if self.axis is not None and self.axis not in (0, 1, 2):
            raise RefusedError(f"the axis of a turn is 0, 1 or 2, got {self.axis}")
        if self.angle_rad is not None and not math.isfinite(self.angle_rad):
            raise RefusedError("the angle of a turn must be finite")
        if self.direction is not None and not 0.99 < math.hypot(*self.direction) < 1.01:
            raise RefusedError("the direction of a turn must be a unit vector")

    @property
    def stated(self) -> FloatArray | None:
        """Rotation vector (3,) [rad] where both angle and axis are stated, else ``None``."""
        if self.angle_rad is None or (self.axis is None and self.direction is None):
            return None
        return self.angle_rad * _unit(self.axis or 0, self.direction)


@dataclass(frozen=True)
class KnownTurn:
    """An identified turn: ``angle_rad`` about ``axis``; ``is_used`` is false when the readings contradict these.

    ``seen_rad`` is the angle by the nominal scale, ``off_axis_rad`` the angle between its axis and the case axis.
    ``direction`` is the axis where it is none of the case's, ``axis`` then the nearest one. ``is_ambiguous``: the scale
    is too uncertain to identify the multiple of 90°.
    """

    axis: int
    angle_rad: float
    is_used: bool
    seen_rad: float
    off_axis_rad: float
    was_given: bool
    direction: tuple[float, float, float] | None = None
    is_ambiguous: bool = False

    @property
    def vector(self) -> FloatArray:
        """Rotation about the turn's axis, (3,), rad."""
        return self.angle_rad * _unit(self.axis, self.direction)


def _unit(axis: int, direction: tuple[float, float, float] | None) -> FloatArray:
    if direction is not None:
        return np.array(direction, dtype=np.float64)
    unit = np.zeros(3)
    unit[axis] = 1.0
    return unit


@dataclass(frozen=True, eq=False)
class MeasuredTurns:
    """``raw_angle`` (k, 3) = ∫w' dt and ``duration_s`` (k,) of the turns and of the static intervals, and their noise.

    ``var_rate`` (3,) is ``N²`` in raw unit² · s; ``bias_spread`` (3,) the variance of the true bias between static
    intervals, ``bias_excess`` (3,) χ² of its constancy. ``hidden`` holds the rounding errors of a coarse ADC.
    """

    raw_angle: FloatArray
    duration_s: FloatArray
    static_angle: FloatArray
    static_duration_s: FloatArray
    var_rate: FloatArray
    bias_spread: FloatArray
    bias_excess: FloatArray
    bias_mean: FloatArray
    hidden: HiddenAngles | None = None


def measure_turns(recording: Recording, turns: Sequence[Turn], static: Sequence[tuple[int, int]]) -> MeasuredTurns:
    """Integrate turns and static intervals; the noise is measured in the static intervals.

    Raises ``RefusedError`` when there is no gyro, no turn, or no static interval, or these are too short to measure the
    noise.
    """
    if recording.gyroscope is None:
        raise RefusedError("the recording has no gyroscope")
    if not turns:
        raise RefusedError("--method faces needs turns: none were given and none were found")
    if not static:
        raise RefusedError("--method faces needs a stretch without rotation: keep the sensor still for some seconds")
    gyroscope = recording.gyroscope
    edges = np.array([[turn.start, turn.stop] for turn in turns], dtype=np.int64)
    raw_angle, duration = integrate_raw_rate(recording.time_s, gyroscope, edges, 3)
    static_edges = np.array([[a, b] for a, b in static], dtype=np.int64)
    static_angle, static_duration = integrate_raw_rate(recording.time_s, gyroscope, static_edges, 1)
    step_s = 1.0 / recording.rate_hz
    sums, count = np.zeros(3), 0
    for start, stop in static:
        block = gyroscope[start:stop]
        block = block[np.all(np.isfinite(block), axis=1)]
        length = min(max(1, round(BLOCK_S / step_s)), len(block) // 4)
        if length < 1:
            continue
        means = block[: len(block) // length * length].reshape(-1, length, 3).mean(axis=1)
        sums += 0.5 * np.sum(np.diff(means, axis=0) ** 2, axis=0) * length * step_s
        count += len(means) - 1
    if count < 4:
        raise RefusedError(
            "the stretches without rotation are too short to measure the gyro's noise: keep still for some seconds"
        )
    var_rate = np.maximum(sums / count, recording.facts.of("gyroscope").step ** 2 / 12.0 * step_s)
    static_s = np.array(static_duration)
    rates = static_angle / static_s[:, None]
    mean, excess, spread = pool_biases(rates, var_rate / static_s[:, None])
    hidden = hidden_angles(
        gyroscope, step_s, recording.facts.of("gyroscope").step, [(t.start, t.stop) for t in turns], static, raw_angle
    )
    return MeasuredTurns(raw_angle, np.array(duration), static_angle, static_s, var_rate, spread, excess, mean, hidden)


AMBIGUOUS = (
    "the readings are counts, and turns of 90, 180 or 360° differ by their scale alone: was each turn 90, 180 or 360°? "
    "Say --turns 90,-90,... (one angle a turn, 0 leaves it out), or the nominal scale (--gyro-nominal, rad/s per count)"
)


def nominal_matrix(
    recording: Recording, measured: MeasuredTurns, turns: Sequence[Turn], nominal_scale: FloatArray | float | None
) -> FloatArray:
    """Nominal scale (3, 3), rad/s per raw unit: from stated turns, else as given, else from the unit.

    Stated turns have precedence. Turns of unknown size determine no scale: any divisor of their angles would fit.
    Raises ``RefusedError`` with the question to the user, when readings are counts and neither angles nor a scale are
    known.
    """
    stated = scale_of_stated(measured, turns)
    if stated is not None:
        return stated
    if nominal_scale is not None:
        value = np.asarray(nominal_scale, dtype=np.float64)
        if value.shape not in ((), (3, 3)) or not np.all(np.isfinite(value)):
            raise RefusedError("nominal_scale must be a finite number or a (3, 3) matrix, rad/s per raw unit")
        return value * np.eye(3) if value.ndim == 0 else value
    unit = rate_to_si(recording.gyroscope_unit)
    if unit is not None:
        return unit * np.eye(3)
    raise RefusedError(AMBIGUOUS)


def scale_of_stated(measured: MeasuredTurns, turns: Sequence[Turn]) -> FloatArray | None:
    """Scale (3, 3), rad/s per raw unit, by a robust fit to stated turns; ``None`` where they do not span three axes.

    Least absolute deviations (reweighted least squares) of ``φ'_i - z̄ Δt_i = S_w φ_i``.
    """
    rows = [(index, turn.stated) for index, turn in enumerate(turns)]
    known = [(index, vector) for index, vector in rows if vector is not None and np.any(vector != 0.0)]
    if len(known) < 3:
        return None
    index = np.array([i for i, _ in known])
    angles = np.array([vector for _, vector in known])
    directions = angles / np.linalg.norm(angles, axis=1, keepdims=True)
    if np.linalg.svd(directions, compute_uv=False)[-1] < MIN_SPREAD:
        return None
    raw = (measured.raw_angle - np.outer(measured.duration_s, measured.bias_mean))[index]
    # Initial weights are equal in relative error; later ones are the inverse of the relative misfit.
    size = np.linalg.norm(angles, axis=1)
    weight: FloatArray = 1.0 / size
    solution = np.zeros((3, 3))
    for _ in range(30):
        solution, *_ = np.linalg.lstsq(angles * weight[:, None], raw * weight[:, None], rcond=None)
        miss = np.linalg.norm(raw - angles @ solution, axis=1) / size
        weight = 1.0 / (size * np.sqrt(np.maximum(miss, 1e-6 * max(float(miss.max()), 1e-300))))
    if np.linalg.cond(solution) > 1.0 / MIN_SPREAD:
        return None
    return np.asarray(np.linalg.inv(solution.T), dtype=np.float64)


def identify_turns(
    measured: MeasuredTurns, turns: Sequence[Turn], nominal: FloatArray, tolerance: float = SCALE_TOLERANCE
) -> list[KnownTurn]:
    """Nearest case axis and nearest multiple of 90° for every turn without a stated one.

    Small turns are identified first: each refines the scale for the next larger one, so that eight whole turns are
    identified although the nominal scale has the relative error ``tolerance``.
    """
    seen = (measured.raw_angle - np.outer(measured.duration_s, measured.bias_mean)) @ nominal.T
    size = np.linalg.norm(seen, axis=1)
    axes = [_axis_of(turn, vector) for turn, vector in zip(turns, seen, strict=True)]
    sums = np.zeros((3, 2))
    known: list[KnownTurn | None] = [None] * len(turns)
    for index in sorted(range(len(turns)), key=lambda i: size[i]):
        turn, axis, vector = turns[index], axes[index], seen[index]
        scale = sums[axis, 0] / sums[axis, 1] if sums[axis, 1] > 0.0 else 1.0
        unit = _unit(axis, turn.direction)
        along = float(vector @ unit) / scale
        off_axis = math.atan2(float(np.linalg.norm(np.cross(vector, unit))), abs(float(vector @ unit)))
        angle = turn.angle_rad if turn.angle_rad is not None else QUARTER * round(along / QUARTER)
        is_ambiguous = False
        if turn.angle_rad is None:
            unsure = abs(along) * (tolerance if sums[axis, 1] == 0.0 else 0.1 * tolerance)
            # A turn is identified only if the scale's uncertainty is below half of 90°.
            is_used = angle != 0.0 and abs(along - angle) < SLACK_RAD + min(unsure, 0.2 * QUARTER)
            is_ambiguous = unsure >= 0.5 * QUARTER
            is_used = is_used and not is_ambiguous
        else:
            is_used = angle != 0.0 and abs(along - angle) < max(SLACK_RAD, 0.3 * abs(angle))
        is_used = is_used and off_axis < 2.0 * SLACK_RAD
        known[index] = KnownTurn(
            axis=axis,
            angle_rad=float(angle),
            is_used=bool(is_used),
            seen_rad=float(along),
            off_axis_rad=off_axis,
            was_given=turn.angle_rad is not None,
            direction=turn.direction,
            is_ambiguous=is_ambiguous,
        )
        if is_used:
            sums[axis] += (float(vector @ unit) * angle, angle * angle)
    return [turn for turn in known if turn is not None]


def _axis_of(turn: Turn, seen: FloatArray) -> int:
    if turn.axis is not None:
        return turn.axis
    return int(np.argmax(np.abs(seen if turn.direction is None else turn.direction)))
