"""Turns on a table by stated angles, in any pose, as rows of a session: ``|S ∫w' dt + b Δt| = |φ|`` about any axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron._core import block_differences, integrate_raw_rate
from trihedron.arrays import TINY, BoolArray, FloatArray, IntArray, rms_of
from trihedron.errors import InputError
from trihedron.estimate.gyroscope.biases import pool_biases
from trihedron.estimate.gyroscope.findings import TurnName, loose_turns, no_multiple, wrong_turn
from trihedron.estimate.gyroscope.measurements import BLOCK_S
from trihedron.estimate.gyroscope.turn_rounding import hidden_angles
from trihedron.estimate.gyroscope.turntable import StatedRates, Updated, not_fitted
from trihedron.probability import FALSE_ALARM, MEDIAN_CHI2, chdtri
from trihedron.records import Calibration, Finding, FindingCode, Move, Recording, Segments, SensorCalibration
from trihedron.sensor_model import correct
from trihedron.transforms import directions_of

SAME_POSE = 2.0 * np.sin(0.5 * np.radians(5.0))
"""Largest change of gravity in a turn on a table, relative: twice the table's tilt, which is two degrees at most."""
QUARTER, SLACK_RAD = 0.5 * np.pi, np.radians(10.0)
"""A turn further than this from every multiple of 90° was not made against a wall."""
SIGMAS = 3.0
"""Standard errors of an angle within that, so that it is told which multiple it is."""
LEAST_RAD = 0.2
"""Smaller rotations about the vertical are no turns: the case was lifted and set down again."""


@dataclass(frozen=True, eq=False)
class TableTurns:
    """``moves`` that leave gravity where it is, with their ``names``, as ``measured``: turns by ``angles`` (k,) [rad]
    about the vertical ``up`` (k, 3), counter-clockwise seen from above, which are stated or taken as such."""

    names: list[TurnName]
    moves: list[Move]
    measured: MeasuredTurns
    angles: FloatArray
    up: FloatArray
    is_stated: bool

    def of(self, used: BoolArray) -> TableTurns:
        """The turns ``used`` (k,)."""
        kept = np.flatnonzero(used)
        names, moves = [self.names[k] for k in kept], [self.moves[k] for k in kept]
        return TableTurns(names, moves, self.measured.of(used), self.angles[used], self.up[used], self.is_stated)

    def along(self, gyro: SensorCalibration) -> tuple[FloatArray, FloatArray]:
        """Angles (k,) [rad] about the vertical by a gyro, and their standard errors."""
        raw, times = self.measured.raw_angle, self.measured.duration_s
        seen = np.sum(self.up * (raw @ gyro.S.T + np.outer(times, gyro.b)), axis=1)
        slope = np.hstack([(self.up[:, :, None] * raw[:, None, :]).reshape(-1, 9), self.up * times[:, None]])
        return seen, np.sqrt(np.einsum("ki,ij,kj->k", slope, gyro.covariance, slope))

    def rates(self) -> StatedRates:
        """The turns as mean rates of known size."""
        measured, lasts_s = self.measured, self.measured.duration_s[:, None]
        return StatedRates(
            mean=measured.raw_angle / lasts_s,
            covariance=(measured.var_rate / lasts_s + measured.bias_spread)[:, :, None] * np.eye(3),
            shared=measured.hidden / lasts_s[:, :, None],
            speeds=np.abs(self.angles) / measured.duration_s,
            unit=1.0 / measured.duration_s,
        )


def table_turns(
    recording: Recording, segments: Segments, accelerometer: SensorCalibration, angles_deg: Sequence[float] | None
) -> TableTurns:
    """The turns of a recording by stated angles [°], 0 of which excludes one; ``None``: all, by angles still unknown.

    Raises ``InputError`` when the numbers of turns and angles differ.
    """
    assert segments.accelerometer_mean is not None
    up = directions_of(correct(segments.accelerometer_mean, accelerometer.S, accelerometer.b))
    level = [one for one in segments.moves if np.linalg.norm(up[one.pose_after] - up[one.pose_before]) < SAME_POSE]
    level = [one for one in level if one.stop - one.start >= 2]
    if angles_deg is None:
        known = [(k, move, 0.0) for k, move in enumerate(level, start=1)]
    else:
        known = stated(recording, level, angles_deg)
    names = [TurnName(k, float(recording.time_s[move.start])) for k, move, _ in known]
    moves = [move for _, move, _ in known]
    measured = measure_turns(recording, moves, resting_spans(segments))
    before = np.array([move.pose_before for move in moves], dtype=np.int64)
    return TableTurns(
        names, moves, measured, np.array([angle for *_, angle in known]), up[before], angles_deg is not None
    )


def by_quarters(turns: TableTurns, calibration: Calibration) -> tuple[TableTurns, list[Finding]]:
    """The turns that a gyro shows to be multiples of 90°, with these angles, and findings on the others.

    Those that are told by its uncertainty improve the scale by which larger ones are told.
    """
    gyro, n_told = calibration.gyroscope, -1
    while True:
        assert gyro is not None
        seen, sigma = turns.along(gyro)
        angles = QUARTER * np.round(seen / QUARTER)
        is_told = SIGMAS * sigma < SLACK_RAD
        is_used = is_told & (angles != 0.0) & (np.abs(seen - angles) < SLACK_RAD)
        found = replace(turns, angles=angles).of(is_used)
        if np.all(is_told) or np.count_nonzero(is_told) <= n_told or not found.moves:
            break
        n_told, gyro = int(np.count_nonzero(is_told)), found.rates().scattered_on(calibration).gyroscope(gyro)
    is_wrong, axes = is_told & ~is_used & (np.abs(seen) > LEAST_RAD), np.argmax(np.abs(turns.up), axis=1)
    said = [no_multiple(turns.names[k], seen[k], int(axes[k])) for k in np.flatnonzero(is_wrong)]
    return found, said if np.all(is_told) else [*said, Finding.of(FindingCode.TURN_ANGLE_UNKNOWN)]


def on_stated_turns(
    calibration: Calibration, recording: Recording, segments: Segments, turns: TableTurns
) -> tuple[Calibration, TableTurns]:
    """The calibration of poses and moves updated with turns on a table, and those that were used.

    Turns that the others and the session contradict are excluded. Raises ``InputError`` when some turned the other way.
    """
    gyro, angles = calibration.gyroscope, turns.angles
    assert gyro is not None
    rates, axes = turns.rates(), np.argmax(np.abs(turns.up), axis=1)
    is_reversed = turns.along(gyro)[0] * angles < 0.0
    if np.any(is_reversed) and not np.all(is_reversed):
        raise other_sense(is_reversed, angles)
    predicted = rates.on(calibration)
    wrong, either = contradicted(predicted, rates.unit)
    is_used = ~np.isin(np.arange(len(angles)), wrong)
    updated = rates.of(is_used).scattered_on(calibration)
    if not updated.is_fitted:
        said = not_fitted(rates, updated, is_turned=True)
        return replace(calibration, findings=(*calibration.findings, said)), turns.of(is_used)
    missed = (rates.predicted(updated.values)[0] - rates.speeds) / rates.unit
    found = [
        wrong_turn(
            turns.names[k], angles[k], int(axes[k]), missed[k], is_excluded=k in wrong, is_stated=turns.is_stated
        )
        for k in (*wrong, *either)
    ]
    found += loose_turns(updated.scatter)
    # An error of a turn as large as it may be against a wall, which no other turn and no move contradicts.
    alone = np.sqrt(predicted.left_out(np.arange(len(angles)), 0.0 * angles)[1]) / rates.unit > SLACK_RAD
    if np.any(alone):
        found.append(Finding.of(FindingCode.TURN_UNCHECKED, axes=sorted({int(axis) + 1 for axis in axes[alone]})))
    rms = rms_of(missed[is_used])
    found.append(Finding.of(FindingCode.TURNTABLE, "turns", turns=int(np.count_nonzero(is_used)), rms_rad=rms))
    if np.all(is_reversed):
        found.append(Finding.of(FindingCode.LEFT_HANDED, "turns-against-moves", turns=len(angles)))
    after = updated.of(calibration, recording, segments)
    return replace(after, findings=(*calibration.findings, *found)), turns.of(is_used)


def contradicted(found: Updated, unit: FloatArray) -> tuple[list[int], list[int]]:
    """Turns that the others show to be wrong, and those of which some are, undecided which.

    Each turn is predicted by all others and what was known before. Their scatter is estimated from the median squared
    error, which is robust to single wrong turns; ``unit`` (k,) is the change of each row by a scatter of one.
    """
    used = np.arange(len(unit))
    wrong: list[int] = []
    error, variance = found.left_out(used, 0.0 * unit)
    scatter2 = float(np.median((error / unit) ** 2) / MEDIAN_CHI2[1] - np.median(variance / unit**2))
    loose = np.sqrt(max(scatter2, 0.0)) * unit
    limit = chdtri(1.0, FALSE_ALARM / len(unit))

    def far(used: IntArray) -> tuple[IntArray, int]:
        error, variance = found.left_out(used, loose)
        return used[error**2 > limit * variance], int(used[np.argmax(error**2 / variance)])

    while len(used) > 1:
        suspects, worst = far(used)
        if not len(suspects):
            break
        # Where the worst is no suspect without another one, that other one may be wrong as well.
        rivals = [k for k in suspects.tolist() if k != worst and worst not in far(used[used != k])[0]]
        if rivals:
            return wrong, [worst, *rivals]
        wrong.append(worst)
        used = used[used != worst]
    return wrong, []


# Turns as measured, and the angles that are stated.


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
