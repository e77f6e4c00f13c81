"""State of a guided session: segmentation, calibration, and the covariance predicted for further poses.

Only here the guide uses the estimators, and of `calibrate` only covariances and findings.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.api.calibrating import calibrate
from trihedron.api.reading import segment
from trihedron.api.verifying import own_calibration, verify
from trihedron.arrays import XYZ, FloatArray, sigmas_of
from trihedron.errors import INPUT_ERRORS
from trihedron.estimate.accelerometer.poses import ENTRIES, parameter_names, pose_in_words
from trihedron.estimate.next_pose import best_next, is_determined, planned, poses_needed, sigma_of
from trihedron.records import Calibration, Recording, Segments, Severity
from trihedron.records.guiding import LEAST_POSES, Accuracy, Examination, Uncertain
from trihedron.records.results import CalibrationResult, VerificationResult
from trihedron.units import STANDARD_GRAVITY_M_S2, acceleration_to_si

SHORTEST_POSE_S, LONGEST_POSE_S = 3.0, 12.0
USUAL_POSE_S = 4.0
_NOT_THE_FIT = ("gravity-defaulted", "unit-contradicted")
QUIET = ("few-poses", "unit-detected")
POSES_PER_GOAL = 2.5
"""Allowed error of a single pose in multiples of the target accuracy: averaging over a dozen poses does the rest."""

GYRO_NAMES = tuple(f"scale of {XYZ[i]}" if i == j else f"{XYZ[j]} into {XYZ[i]}" for i in range(3) for j in range(3))


def examine(recording: Recording, accuracy: Accuracy, *, gravity_m_s2: float = STANDARD_GRAVITY_M_S2) -> Examination:
    """Poses so far and still needed, every parameter's uncertainty now and after the next pose, and the best next one.

    Too few poses raise nothing: unknown values are None.
    """
    segments = segment(recording)
    calibration = None if segments.n_poses < 6 else own_calibration(recording, segments, gravity_m_s2)
    centre, matrix = _rough_model(recording, segments, calibration)
    up = _unit((_means(segments) - centre) @ matrix.T)
    known = planned(recording, segments, calibration, up, (centre, matrix, gravity_m_s2))
    now_a, now_g = _now(calibration, gravity_m_s2)
    # The ratio of the fit's uncertainty to the planned one (correlated poses, noise too small) is assumed to persist.
    ratio_a = _ratio(now_a, known.accelerometer)
    ratio_g = 1.0 if known.gyroscope is None else _ratio(now_g, known.gyroscope)
    wanted = np.concatenate([np.full(9, accuracy.accelerometer), np.full(9, accuracy.gyroscope)])
    factor = np.concatenate([np.full(9, ratio_a), np.full(9, ratio_g)])
    best, future = best_next(known, wanted, factor)
    after = sigma_of(future) * factor
    now = np.concatenate([now_a, now_g])
    shortfall = float(
        np.max(np.where(np.isfinite(now), now / wanted, np.inf)[: 18 if known.gyroscope is not None else 9])
    )
    needed = poses_needed(known, wanted, factor, shortfall)
    if needed is not None:
        needed = max(needed, LEAST_POSES - len(up))
    doubts, found = _doubts(calibration), (*recording.findings, *segments.findings)
    uncertain = _uncertain(now, after, wanted, has_gyroscope=known.gyroscope is not None)
    return Examination(
        poses_up=up,
        uncertain=uncertain,
        shortfall=shortfall,
        next_up=best,
        next_words=pose_in_words(best),
        why=_why(uncertain, LEAST_POSES - len(up) if shortfall <= 1.0 else 0),
        poses_needed=needed,
        pose_s=_pose_s(known.pose_sigma, accuracy, segments),
        warnings=(*doubts, *(f.seen for f in found if f.severity is not Severity.NOTE and f.code not in QUIET))[:4],
        rate_hz=recording.rate_hz,
        doubts=doubts,
        centre=centre,
        matrix=matrix,
    )


def part_of(recording: Recording, start_s: float, stop_s: float) -> Recording:
    """The samples with ``start_s <= time < stop_s``, as a recording whose time starts at 0."""
    first, last = (int(i) for i in np.searchsorted(recording.time_s, [start_s, stop_s]))
    rows = slice(first, max(last, first + 1))

    def cut(values: FloatArray | None) -> FloatArray | None:
        return None if values is None else values[rows]

    return replace(
        recording,
        time_s=recording.time_s[rows] - recording.time_s[rows][0],
        accelerometer=cut(recording.accelerometer),
        gyroscope=cut(recording.gyroscope),
        temperature_degc=cut(recording.temperature_degc),
        supply_v=cut(recording.supply_v),
        sha256="",
        auxiliary=type(recording.auxiliary)({}),
    )


def conclude(
    recording: Recording, cut_s: float | None, **place: float | None
) -> tuple[CalibrationResult, VerificationResult | None]:
    """Calibrate from the samples before ``cut_s`` and verify on the later ones; ``place`` as for ``calibrate``.

    Raises ``InputError`` when the samples do not determine a calibration.
    """
    before = recording if cut_s is None else part_of(recording, -np.inf, cut_s)
    result = calibrate(before, **place)  # type: ignore[arg-type]
    if cut_s is None or cut_s >= recording.time_s[-1]:
        return result, None
    # The check includes the last pose of the calibration: its first move starts there.
    last = before.time_s[result.segments.poses[-1].start] + before.time_s[0] if result.segments.n_poses else cut_s
    held_back = part_of(recording, float(last), np.inf)
    segments = segment(held_back)
    # A verification needs few poses, so that the finding about few poses is dropped.
    kept = tuple(finding for finding in segments.findings if finding.code != "few-poses")
    try:
        return result, verify(result.calibration, held_back, segments=replace(segments, findings=kept))
    except INPUT_ERRORS:
        return result, None


def _means(segments: Segments) -> FloatArray:
    return np.zeros((0, 3)) if segments.accelerometer_mean is None else segments.accelerometer_mean


def _rough_model(
    recording: Recording, segments: Segments, calibration: Calibration | None
) -> tuple[FloatArray, FloatArray]:
    """(centre (3,), matrix (3, 3)): matrix · (raw reading − centre) is a vector along up in the body."""
    if calibration is not None and is_determined(calibration):
        S = calibration.accelerometer.S
        centre: FloatArray = np.asarray(-np.linalg.solve(S, calibration.accelerometer.b), dtype=np.float64)
        return centre, S
    means = _means(segments)
    readings = recording.accelerometer
    if readings is None or acceleration_to_si(recording.accelerometer_unit) is not None:
        return np.zeros(3), np.eye(3)
    lowest, highest = float(np.nanmin(readings)), float(np.nanmax(readings))
    if lowest >= 0.0:
        # An unsigned ADC: the reading at 0 g is near the middle of its range.
        bits = max(int(np.ceil(np.log2(highest + 1.0))), 1)
        return np.full(3, 2.0 ** (bits - 1)), np.eye(3)
    if len(means) >= 6:
        return 0.5 * (means.min(axis=0) + means.max(axis=0)), np.eye(3)
    return np.zeros(3), np.eye(3)


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)


def _now(calibration: Calibration | None, gravity: float) -> tuple[FloatArray, FloatArray]:
    """Relative standard errors by the fit: accelerometer (9,), gyro (9,); NaN where it determines none."""
    nan = np.full(9, np.nan)
    if calibration is None or not is_determined(calibration):
        return nan, nan
    sensor = calibration.accelerometer
    sigma = sigmas_of(sensor.covariance)
    scale = np.linalg.norm(sensor.S, axis=0)
    matrix = sigma[:9].reshape(3, 3) / scale
    accelerometer = np.array([*(matrix[j, k] for j, k in ENTRIES), *(sigma[9:] / gravity)])
    gyroscope = calibration.gyroscope
    if gyroscope is None or (gyroscope.observability is not None and gyroscope.observability.rank < 9):
        return accelerometer, nan
    size = np.linalg.norm(gyroscope.S, axis=0)
    errors = sigmas_of(gyroscope.covariance)[:9].reshape(3, 3) / size
    return accelerometer, errors.ravel()


def _ratio(now: FloatArray, covariance: FloatArray) -> float:
    if not np.all(np.isfinite(now)):
        return 1.0
    return float(np.clip(np.median(now / np.sqrt(np.diag(covariance))), 0.2, 20.0))


def _uncertain(now: FloatArray, after: FloatArray, wanted: FloatArray, *, has_gyroscope: bool) -> tuple[Uncertain, ...]:
    names = [*(("accelerometer", name) for name in parameter_names()), *(("gyro", name) for name in GYRO_NAMES)]

    def number(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    return tuple(
        Uncertain(sensor, name, number(now[i]), number(after[i]), float(wanted[i]))
        for i, (sensor, name) in enumerate(names[: 18 if has_gyroscope else 9])
    )


def _why(uncertain: tuple[Uncertain, ...], n_testing: int) -> str:
    if n_testing > 0:
        return f"All uncertainties are within the goal; {n_testing} more poses have to test the fit."
    worst = max(uncertain, key=lambda one: (np.inf if one.now is None else one.now) / one.wanted)
    if worst.now is None:
        open_ones = [one for one in uncertain if one.now is None]
        after = max(open_ones, key=lambda one: (one.after_next or 0.0) / one.wanted)
        count = f"{len(open_ones)} of {len(uncertain)} parameters"
        return f"No uncertainty yet of {count}: a combination is open, {after.sensor} {after.name} most."
    then = "" if worst.after_next is None else f"; this pose brings it to {100 * worst.after_next:.2g} %"
    return f"Worst is {worst.sensor} {worst.name}: {100 * worst.now:.2g} %, wanted {100 * worst.wanted:.2g} %{then}."


def _pose_s(pose_sigma: float, accuracy: Accuracy, segments: Segments) -> float:
    """Duration of a pose [s] for which its error is ``POSES_PER_GOAL`` times the target; noise falls as 1/√time."""
    held = float(np.median(segments.duration_s)) if segments.n_poses else USUAL_POSE_S
    excess = pose_sigma / (POSES_PER_GOAL * accuracy.accelerometer)
    return float(np.clip(held * excess**2, SHORTEST_POSE_S, LONGEST_POSE_S))


def _doubts(calibration: Calibration | None) -> tuple[str, ...]:
    if calibration is None:
        return ()
    grave = [f for f in calibration.findings if f.severity is Severity.SERIOUS or f.code == "outlier-pose"]
    return tuple(f.seen for f in grave if f.code not in _NOT_THE_FIT)
