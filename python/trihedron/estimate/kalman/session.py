"""Input of the filters from a recording and its poses: mean readings, times, noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.estimate.accelerometer.face_poses import are_six_faces
from trihedron.estimate.accelerometer.norm import calibrate_norm
from trihedron.estimate.accelerometer.poses import PoseDesign
from trihedron.estimate.accelerometer.verdict import observability_findings
from trihedron.estimate.kalman.norm_invariant import START_RELATIVE, NormFrame, calibrate_without_references
from trihedron.estimate.kalman.per_axis import calibrate_with_references
from trihedron.records import (
    AxisNoise,
    Finding,
    KalmanCalibration,
    NormKalmanCalibration,
    Observability,
    PoseTable,
    Recording,
    Segments,
)
from trihedron.sensor_model import correct
from trihedron.transforms import directions_of
from trihedron.units import AccelerationUnit


@dataclass(frozen=True, eq=False)
class PoseReadings:
    """Mean raw readings (n, 3) of the poses, start times and lengths (n,) [s], standard errors (n, 3) of the means."""

    mean: FloatArray
    start_s: FloatArray
    pose_s: FloatArray
    sigma_mean: FloatArray


def pose_readings(recording: Recording, segments: Segments, table: PoseTable | None = None) -> PoseReadings:
    """Means of the poses, matched with a pose table.

    With start and stop times the readings are averaged over these; with pose numbers the table selects poses of the
    log; with neither it must have as many rows as the log has poses. Raises ``InputError`` when there is no
    accelerometer, the log has no pose, or table and log do not match.
    """
    a = recording.accelerometer
    if a is None:
        raise InputError(f"{recording.source}: there is no accelerometer to calibrate in this log")
    if table is not None and table.start_s is not None and table.stop_s is not None:
        return _timed_means(recording, segments, a, table.start_s, table.stop_s)
    mean, sigma = segments.accelerometer_mean, segments.norm_sigma
    if mean is None or sigma is None or segments.n_poses == 0:
        raise InputError(f"{recording.source}: no pose was found, so there is nothing to calibrate from")
    step = 1.0 / recording.rate_hz
    start = np.array([recording.time_s[pose.start] for pose in segments.poses])
    length = np.array([recording.time_s[pose.stop - 1] + step for pose in segments.poses]) - start
    chosen = np.arange(segments.n_poses)
    if table is not None and table.pose is not None:
        chosen = np.asarray(table.pose, dtype=np.intp)
        if np.any(chosen >= segments.n_poses):
            worst = int(np.max(chosen)) + 1
            raise InputError(
                f"{table.source}: pose {worst} is requested, but {recording.source} has {segments.n_poses} poses"
            )
        if np.any(np.diff(chosen) <= 0):
            raise InputError(f"{table.source}: give the poses in the order in which they were recorded, each once")
    elif table is not None and len(table) != segments.n_poses:
        raise InputError(
            f"{table.source} has {len(table)} rows, but {recording.source} has {segments.n_poses} poses: add "
            "a column 'pose' with the number of the pose (`trihedron segment` lists them), or 'start' and 'stop'"
        )
    return PoseReadings(mean[chosen], start[chosen], length[chosen], sigma[chosen])


def _timed_means(
    recording: Recording, segments: Segments, a: FloatArray, start_s: FloatArray, stop_s: FloatArray
) -> PoseReadings:
    n = len(start_s)
    mean, sigma = np.empty((n, 3)), np.empty((n, 3))
    noise = segments.accelerometer_sigma
    for i, (start, stop) in enumerate(zip(start_s, stop_s, strict=True)):
        first, last = np.searchsorted(recording.time_s, [start, stop])
        rows = a[first:last]
        rows = rows[np.isfinite(rows).all(axis=1)]
        if len(rows) < 2:
            raise InputError(f"pose {i + 1}: the log has {len(rows)} readings from {start:g} s to {stop:g} s")
        mean[i] = rows.mean(axis=0)
        scatter = rows.std(axis=0, ddof=1) if noise is None else noise
        sigma[i] = scatter / np.sqrt(len(rows))
    return PoseReadings(mean, np.array(start_s), np.array(stop_s) - np.array(start_s), sigma)


def noise_from_poses(recording: Recording, segments: Segments) -> tuple[AxisNoise, AxisNoise, AxisNoise]:
    """White noise from the scatter inside the poses, and the LSB where it exceeds that; no slow noise."""
    sigma = np.zeros(3) if segments.accelerometer_sigma is None else segments.accelerometer_sigma
    steps = recording.facts.of("accelerometer").step
    # An LSB below the noise is dithered and already in the scatter.
    x, y, z = (
        AxisNoise(white=own / np.sqrt(recording.rate_hz), resolution=step if step > own else 0.0, sample_sigma=own)
        for own, step in zip(sigma.tolist(), steps.tolist(), strict=True)
    )
    return x, y, z


def _noise(
    recording: Recording, segments: Segments, noise: AxisNoise | Sequence[AxisNoise] | None, poses: PoseReadings
) -> tuple[AxisNoise | Sequence[AxisNoise], FloatArray, tuple[Finding, ...]]:
    if noise is not None:
        return noise, np.zeros_like(poses.mean), ()
    assumed = noise_from_poses(recording, segments)
    white = np.array([one.white for one in assumed])
    # The variance of each mean beyond white noise, from the segmentation, is added.
    extra = np.maximum(poses.sigma_mean**2 - white**2 / poses.pose_s[:, None], 0.0)
    finding = Finding.of("noise-assumed")
    return assumed, extra, (finding,)


def calibrate_session(
    recording: Recording, segments: Segments, table: PoseTable, *, noise: AxisNoise | Sequence[AxisNoise] | None = None
) -> KalmanCalibration:
    """Calibrate the accelerometer of a recording in the known attitudes of a pose table, by all methods for comparison.

    With ``noise`` None white noise and resolution are estimated from the poses, with a finding. Raises ``InputError``
    when table and log do not match, or the poses do not determine the constants.
    """
    poses = pose_readings(recording, segments, table)
    used, extra, findings = _noise(recording, segments, noise, poses)
    result = calibrate_with_references(
        poses.mean,
        replace(table, pose=None, start_s=None, stop_s=None),
        used,
        start_s=poses.start_s,
        pose_s=poses.pose_s,
        extra_variance=extra,
        raw_unit=recording.accelerometer_unit.value,
    )
    return replace(result, findings=(*findings, *result.findings))


def calibrate_session_without_references(
    recording: Recording,
    segments: Segments,
    *,
    gravity_m_s2: float,
    noise: AxisNoise | Sequence[AxisNoise] | None = None,
    frame: NormFrame = "lower",
) -> NormKalmanCalibration:
    """Calibrate the accelerometer of a recording from the norm of gravity in its poses.

    Raises ``InputError`` when there are fewer than nine poses.
    """
    poses = pose_readings(recording, segments)
    used, extra, findings = _noise(recording, segments, noise, poses)
    result = calibrate_without_references(
        poses.mean,
        used,
        start_s=poses.start_s,
        pose_s=poses.pose_s,
        gravity_m_s2=gravity_m_s2,
        frame=frame,
        extra_variance=extra,
        raw_unit=recording.accelerometer_unit.value,
    )
    observability, weak = _observed(poses, gravity_m_s2, recording.accelerometer_unit)
    accelerometer = replace(result.accelerometer, observability=observability)
    return replace(result, accelerometer=accelerometer, findings=(*findings, *result.findings, *weak))


def _observed(
    poses: PoseReadings, gravity_m_s2: float, unit: AccelerationUnit
) -> tuple[Observability, tuple[Finding, ...]]:
    """What the poses determine, judged as by ``calibrate``: one verdict for one session."""
    sensor, seen = calibrate_norm(poses.mean, poses.sigma_mean, gravity_m_s2, raw_unit=unit)
    assert sensor.quality is not None
    sigma = sensor.quality.sigma / gravity_m_s2
    design = PoseDesign.of(directions_of(correct(poses.mean, sensor.S, sensor.b)), sigma)
    observability = design.observability(float(np.median(sigma)))
    outliers = [finding for finding in seen if finding.code == "outlier-pose"]
    weak = observability_findings(
        design,
        float(np.median(sigma)),
        observability.advice,
        is_anchored=any(finding.code == "not-observable" for finding in seen),
        anchor=START_RELATIVE,
        are_faces=are_six_faces(poses.mean),
    )
    return observability, (*outliers, *weak)
