"""Turns on a table by stated angles, in any pose, as rows of a session: ``|S ∫w' dt + b Δt| = |φ|`` about any axis."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray, IntArray, rms_of
from trihedron.estimate.gyroscope.findings import TurnName, loose_turns, wrong_turn
from trihedron.estimate.gyroscope.turn_angles import (
    MeasuredTurns,
    measure_turns,
    other_sense,
    resting_spans,
    stated,
)
from trihedron.estimate.gyroscope.turntable import Predicted, StatedRates, not_fitted
from trihedron.probability import FALSE_ALARM, MEDIAN_CHI2, chdtri
from trihedron.records import Calibration, Finding, FindingCode, Recording, Segments, SensorCalibration
from trihedron.sensor_model import correct
from trihedron.transforms import directions_of

SAME_POSE = 2.0 * np.sin(0.5 * np.radians(5.0))
"""Largest change of gravity in a turn on a table, relative: twice the table's tilt, which is two degrees at most."""


def on_stated_turns(
    calibration: Calibration, recording: Recording, segments: Segments, angles_deg: Sequence[float]
) -> Calibration:
    """The calibration of poses and moves updated with turns about the vertical by stated angles [°]; 0 excludes one.

    Angles are positive counter-clockwise seen from above. Turns that the others and the session contradict are
    excluded; without a gyro nothing changes. Raises ``InputError`` when the numbers of turns and angles differ, or some
    turned the other way.
    """
    gyro = calibration.gyroscope
    if gyro is None:
        return calibration
    at, measured, angles, axes = _turns(recording, segments, calibration.accelerometer, angles_deg)
    lasts_s = measured.duration_s[:, None]
    rates = StatedRates(
        mean=measured.raw_angle / lasts_s,
        covariance=(measured.var_rate / lasts_s + measured.bias_spread)[:, :, None] * np.eye(3),
        shared=measured.hidden[:-1] / lasts_s[:, :, None],
        speeds=np.abs(angles) / measured.duration_s,
        unit=1.0 / measured.duration_s,
    )
    is_reversed = np.sum(axes * correct(rates.mean, gyro.S, gyro.b), axis=1) * angles < 0.0
    if np.any(is_reversed) and not np.all(is_reversed):
        raise other_sense(is_reversed, angles)
    wrong, either = contradicted(rates.on(calibration), rates.unit)
    is_used = ~np.isin(np.arange(len(angles)), wrong)
    updated = rates.of(is_used).scattered_on(calibration)
    if not updated.is_fitted:
        return replace(calibration, findings=(*calibration.findings, not_fitted(rates, updated, is_turned=True)))
    missed = (rates.predicted(updated.values)[0] - rates.speeds) / rates.unit
    said = [
        wrong_turn(at[k], angles[k], int(np.argmax(np.abs(axes[k]))), missed[k], is_excluded=k in wrong, is_stated=True)
        for k in (*wrong, *either)
    ]
    said += loose_turns(updated.scatter)
    rms = rms_of(missed[is_used])
    said.append(Finding.of(FindingCode.TURNTABLE, "turns", turns=int(np.count_nonzero(is_used)), rms_rad=rms))
    if np.all(is_reversed):
        said.append(Finding.of(FindingCode.LEFT_HANDED, "turns-against-moves", turns=len(angles)))
    after = updated.of(calibration, recording, segments)
    return replace(after, findings=(*calibration.findings, *said))


def _turns(
    recording: Recording, segments: Segments, accelerometer: SensorCalibration, angles_deg: Sequence[float]
) -> tuple[list[TurnName], MeasuredTurns, FloatArray, FloatArray]:
    """Moves that do not change gravity's direction, their stated angles (k,) [rad], and the vertical (k, 3) in each."""
    assert segments.accelerometer_mean is not None
    up = directions_of(correct(segments.accelerometer_mean, accelerometer.S, accelerometer.b))
    is_level = [np.linalg.norm(up[one.pose_after] - up[one.pose_before]) < SAME_POSE for one in segments.moves]
    known = stated(recording, [one for one, level in zip(segments.moves, is_level, strict=True) if level], angles_deg)
    numbers, moves, angles = zip(*known, strict=True) if known else ((), (), ())
    at = [TurnName(k, float(recording.time_s[move.start])) for k, move in zip(numbers, moves, strict=True)]
    measured = measure_turns(recording, moves, resting_spans(segments))
    return at, measured, np.array(angles), np.array([up[move.pose_before] for move in moves])


def contradicted(found: Predicted, unit: FloatArray) -> tuple[list[int], list[int]]:
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
