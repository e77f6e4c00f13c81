"""Turns on a table by stated angles, in any pose, as rows of a session: ``|S ∫w' dt + b Δt| = |φ|`` about any axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron._core import integrate_raw_rate
from trihedron.arrays import BoolArray, FloatArray, IntArray, rms_of
from trihedron.errors import InputError
from trihedron.estimate.gyroscope.biases import pool_biases
from trihedron.estimate.gyroscope.measurements import rate_noise_density
from trihedron.estimate.gyroscope.turn_rounding import hidden_angles
from trihedron.estimate.gyroscope.turntable import StatedRates, moved_to, not_fitted, with_parameters
from trihedron.probability import FALSE_ALARM, MEDIAN_CHI2, chdtri
from trihedron.records import Calibration, Finding, Move, Recording, Segments, SensorCalibration
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
LOOSE_RAD = np.radians(1.0)
"""Scatter of turns above which it is reported: a square case against a wall repeats to some tenths of a degree."""
MIN_SPREAD = 0.2
"""Smallest singular value of unit turn axes that determine all of S: three axes within some 10° of one plane have
less."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TableTurns:
    """``moves`` that leave gravity where it is, with their ``numbers`` (k,) among all, from one, which begin at
    ``begin_s`` (k,): turns by ``angles`` (k,) [rad] about the vertical ``up`` (k, 3), counter-clockwise seen from
    above, which are stated or taken as such.

    ``raw_angle`` (k, 3) = ∫w' dt and ``duration_s`` (k,) of each, with the ``variance`` (k, 3) of its raw angles, and
    ``hidden`` (k, 3, m), errors by rounding; ``bias`` (3,) at rest.
    """

    moves: list[Move]
    numbers: IntArray
    begin_s: FloatArray
    angles: FloatArray
    up: FloatArray
    is_stated: bool
    raw_angle: FloatArray
    duration_s: FloatArray
    variance: FloatArray
    hidden: FloatArray
    bias: FloatArray

    def of(self, used: BoolArray) -> TableTurns:
        """The turns ``used`` (k,)."""
        return replace(
            self, moves=[self.moves[k] for k in np.flatnonzero(used)], numbers=self.numbers[used],
            begin_s=self.begin_s[used], angles=self.angles[used], up=self.up[used], raw_angle=self.raw_angle[used],
            duration_s=self.duration_s[used], variance=self.variance[used], hidden=self.hidden[used],
        )  # fmt: skip

    def along(self, gyro: SensorCalibration) -> tuple[FloatArray, FloatArray]:
        """Angles (k,) [rad] about the vertical by a gyro, and their standard errors."""
        raw, times = self.raw_angle, self.duration_s
        seen = np.sum(self.up * (raw @ gyro.S.T + np.outer(times, gyro.b)), axis=1)
        slope = np.hstack([(self.up[:, :, None] * raw[:, None, :]).reshape(-1, 9), self.up * times[:, None]])
        return seen, np.sqrt(np.einsum("ki,ij,kj->k", slope, gyro.covariance, slope))

    def rates(self) -> StatedRates:
        """The turns as mean rates of known size."""
        lasts_s = self.duration_s[:, None]
        return StatedRates(
            mean=self.raw_angle / lasts_s,
            covariance=(self.variance / lasts_s**2)[:, :, None] * np.eye(3),
            shared=self.hidden / lasts_s[:, :, None],
            speeds=np.abs(self.angles) / self.duration_s,
            unit=1.0 / self.duration_s,
        )

    @property
    def axes(self) -> IntArray:
        """(k,) axis nearest to the vertical, from one."""
        return np.asarray(np.argmax(np.abs(self.up), axis=1) + 1)


def table_turns(
    recording: Recording, segments: Segments, accelerometer: SensorCalibration, angles_deg: Sequence[float] | None
) -> TableTurns:
    """The turns of a recording by stated angles [°], 0 of which excludes one; ``None``: all, by angles still unknown.

    The noise is measured at rest. Raises ``InputError`` when the numbers of turns and angles differ, or the poses are
    too short for it.
    """
    assert segments.accelerometer_mean is not None
    up = directions_of(correct(segments.accelerometer_mean, accelerometer.S, accelerometer.b))
    level = [one for one in segments.moves if np.linalg.norm(up[one.pose_after] - up[one.pose_before]) < SAME_POSE]
    level = [one for one in level if one.stop - one.start >= 2]
    if angles_deg is None:
        known = [(k, move, 0.0) for k, move in enumerate(level, start=1)]
    else:
        known = stated(recording, level, angles_deg)
    # Static poses are turns by 0°, which determine the bias.
    still = [(pose.start, pose.stop) for pose in segments.poses if pose.stop - pose.start >= 2]
    before = np.array([move.pose_before for _, move, _ in known], dtype=np.int64)
    return measured_turns(recording, known, up[before], still, is_stated=angles_deg is not None)


def measured_turns(
    recording: Recording,
    known: Sequence[tuple[int, Move, float]],
    up: FloatArray,
    still: Sequence[tuple[int, int]],
    *,
    is_stated: bool,
) -> TableTurns:
    """The ``known`` turns (number, move, angle) about verticals ``up`` (k, 3), integrated; the noise is measured where
    the sensor is ``still``.

    Raises ``InputError`` when that is too short.
    """
    gyroscope, quantum = recording.gyroscope, recording.facts.of("gyroscope").step
    assert gyroscope is not None
    numbers, moves, angles = zip(*known, strict=True) if known else ((), (), ())
    edges = np.array([[turn.start, turn.stop] for turn in moves], dtype=np.int64).reshape(-1, 2)
    static = np.array(still, dtype=np.int64)
    raw_angle, duration_s = integrate_raw_rate(recording.time_s, gyroscope, edges, 3)
    static_angle, static_s = integrate_raw_rate(recording.time_s, gyroscope, static, 1)
    var_rate, rest_s = rate_noise_density(recording, [[span] for span in still]) ** 2, np.array(static_s)[:, None]
    bias, _, spread = pool_biases(static_angle / rest_s, var_rate / rest_s)
    lasts_s = np.array(duration_s)[:, None]
    return TableTurns(
        moves=list(moves),
        numbers=np.array(numbers, dtype=np.int64),
        begin_s=recording.time_s[edges[:, 0]],
        angles=np.array(angles, dtype=np.float64),
        up=up,
        is_stated=is_stated,
        raw_angle=raw_angle,
        duration_s=lasts_s[:, 0],
        variance=var_rate * lasts_s + spread * lasts_s**2,
        hidden=hidden_angles(gyroscope, 1.0 / recording.rate_hz, quantum, edges, static, raw_angle),
        bias=bias,
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
        n_told, updated = int(np.count_nonzero(is_told)), found.rates().scattered_on(calibration)
        gyro = with_parameters(gyro, updated.values[12:], updated.covariance[12:, 12:])
    is_wrong = is_told & ~is_used & (np.abs(seen) > LEAST_RAD)
    said = [
        Finding.of(
            "turn-not-a-multiple", "no-multiple", turn=int(turns.numbers[k]), at_s=float(turns.begin_s[k]),
            axis=int(turns.axes[k]), seen_rad=seen[k],
        )
        for k in np.flatnonzero(is_wrong)
    ]  # fmt: skip
    return found, said if np.all(is_told) else [*said, Finding.of("turn-angle-unknown")]


def on_stated_turns(
    calibration: Calibration, recording: Recording, segments: Segments, turns: TableTurns
) -> tuple[Calibration, TableTurns]:
    """The calibration of poses and moves updated with turns on a table, and those that were used.

    Turns that the others and the session contradict are excluded. Raises ``InputError`` when some turned the other way.
    """
    gyro, angles = calibration.gyroscope, turns.angles
    assert gyro is not None
    rates = turns.rates()
    is_reversed = turns.along(gyro)[0] * angles < 0.0
    if np.any(is_reversed) and not np.all(is_reversed):
        raise other_sense(is_reversed, angles)
    wrong, either = contradicted(rates, calibration)
    is_used = ~np.isin(np.arange(len(angles)), wrong)
    updated = rates.of(is_used).scattered_on(calibration)
    if not updated.is_fitted:
        said = not_fitted(rates, updated, is_turned=True)
        return replace(calibration, findings=(*calibration.findings, said)), turns.of(is_used)
    missed = (rates.predicted(updated.values)[0] - rates.speeds) / rates.unit
    found = [
        Finding.of(
            "turn-not-a-multiple", "left-out" if k in wrong else "contradicted", turn=int(turns.numbers[k]),
            at_s=float(turns.begin_s[k]), is_stated=turns.is_stated, angle_rad=angles[k], axis=int(turns.axes[k]),
            deviation_rad=abs(missed[k]),
        )
        for k in (*wrong, *either)
    ]  # fmt: skip
    if updated.scatter > LOOSE_RAD:
        found.append(Finding.of("turn-not-a-multiple", "scatter", sigma_turn_rad=updated.scatter))
    # An error of a turn as large as it may be against a wall, which no other turn and no move contradicts.
    alone = np.sqrt(left_out(rates, calibration)[1]) / rates.unit > SLACK_RAD
    if np.any(alone):
        found.append(Finding.of("turn-unchecked", axes=sorted(set(turns.axes[alone].tolist()))))
    rms = rms_of(missed[is_used])
    found.append(Finding.of("turntable", "turns", turns=int(np.count_nonzero(is_used)), rms_rad=rms))
    if np.all(is_reversed):
        found.append(Finding.of("left-handed", "turns-against-moves", turns=len(angles)))
    after = moved_to(calibration, updated.values, updated.covariance, recording, segments)
    return replace(after, findings=(*calibration.findings, *found)), turns.of(is_used)


def contradicted(rates: StatedRates, calibration: Calibration) -> tuple[list[int], list[int]]:
    """Turns that the others show to be wrong, and those of which some are, undecided which.

    Each turn is predicted by all others and what was known before. Their scatter is estimated from the median squared
    error, which is robust to single wrong turns.
    """
    used = np.arange(len(rates.unit))
    wrong: list[int] = []
    error, variance = left_out(rates, calibration)
    scatter2 = float(np.median((error / rates.unit) ** 2) / MEDIAN_CHI2[1] - np.median(variance / rates.unit**2))
    loose, limit = math.sqrt(max(scatter2, 0.0)), chdtri(1.0, FALSE_ALARM / len(used))

    def far(used: IntArray) -> tuple[IntArray, int]:
        error, variance = left_out(rates.of(np.isin(np.arange(len(rates.unit)), used)), calibration, loose)
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


def left_out(rates: StatedRates, calibration: Calibration, scatter: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Error (k,) of each rate as the others predict it, and its variance (k,)."""
    error, covariance = rates.on(calibration, scatter).left_out(np.arange(len(rates.unit))[:, None])
    return error[:, 0], covariance[:, 0, 0]


def other_sense(is_reversed: BoolArray, angles: FloatArray) -> InputError:
    """The error for turns by stated ``angles`` (k,) [rad] some of which the gyro shows to be ``is_reversed`` (k,)."""
    said = ",".join(f"{math.degrees(angle):g}" for angle in np.where(is_reversed, -angles, angles))
    numbers = ", ".join(str(k + 1) for k in np.flatnonzero(is_reversed))
    return InputError(
        f"the gyro turned the other way in turn {numbers} than the stated angles say: as it read them they are "
        f"--turns {said}"
    )


def scale_of_stated(turns: TableTurns) -> FloatArray | None:
    """Scale (3, 3), rad/s per raw unit, near that of the turns; ``None`` where they do not span three axes.

    Least squares of ``φ'_i - z̄ Δt_i = S_w φ_i``, relative to each angle; a wrong turn is found by the session.
    """
    angles, raw = turns.angles[:, None] * turns.up, turns.raw_angle - np.outer(turns.duration_s, turns.bias)
    size: FloatArray = np.linalg.norm(angles, axis=1, keepdims=True)
    if len(size) < 3 or np.linalg.svd(angles / size, compute_uv=False)[-1] < MIN_SPREAD:
        return None
    solution = np.linalg.lstsq(angles / size, raw / size, rcond=None)[0]
    return None if np.linalg.cond(solution) > 1.0 / MIN_SPREAD else np.asarray(np.linalg.inv(solution.T))


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
