"""Calibrate by Kalman filter: in known attitudes where there is a pose table, by the length of gravity otherwise."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace

from trihedron.api.choices import settle_gravity
from trihedron.api.reading import AnyRecording, recording_of, segments_of
from trihedron.channel_facts.static_axes import SHORTEST as SHORTEST_POSE
from trihedron.errors import InputError
from trihedron.estimate.kalman.identified import check_same_adc, check_same_gravity, noise_from_identified
from trihedron.estimate.kalman.norm_invariant import NormFrame
from trihedron.estimate.kalman.session import calibrate_session, calibrate_session_without_references
from trihedron.estimate.noise.identify import identify_noise
from trihedron.estimate.noise.poses import noise_of_poses
from trihedron.files.noise import read_noise_axes
from trihedron.read import read_axis_noise, read_pose_table, read_recording
from trihedron.records import (
    AxisNoise,
    Calibration,
    Finding,
    KalmanCalibration,
    NormKalmanCalibration,
    PoseTable,
    Progress,
    Recording,
    Segments,
    Severity,
)
from trihedron.records.checked import WrongTypeError
from trihedron.records.noise import Noise, NoiseAxis
from trihedron.records.results import KalmanResult

NoiseSource = AxisNoise | Sequence[AxisNoise] | Noise | str | os.PathLike[str]


def kalman(
    recording: AnyRecording,
    reference: PoseTable | str | os.PathLike[str] | None = None,
    *,
    segments: Segments | None = None,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
    sigma_angle_deg: float = 0.0,
    noise: NoiseSource | None = None,
    frame: NormFrame = "lower",
    progress: Progress | None = None,
) -> KalmanResult:
    """Calibrate the accelerometer by Kalman filter with its noise in the state (docs/kalman.md).

    Parameters
    ----------
    recording : Recording, or what trihedron.read takes
        The log of poses.
    reference : PoseTable or file, optional
        Attitudes of the poses: pitch and roll, or directions. Without it only the length of gravity is used.
    sigma_angle_deg : float
        Standard error of the angles in the file.
    noise : AxisNoise, three of them, Noise, or file
        Noise of the raw readings: as identified (the JSON of ``trihedron allan``), its Allan coefficients (a JSON of
        your own), or a static log to identify it from.
        Without it, the noise inside the poses.
    frame : "lower" or "symmetric"
        Body frame where there is no reference; with one it is the frame of the reference.
    segments : Segments, found when not given
    gravity_m_s2 or latitude_deg, height_m : float
        As for :func:`calibrate`.
    progress : callable(share done from 0 to 1, what is being done)

    Returns
    -------
    KalmanResult
        ``calibration`` of the accelerometer with the track of its constants, pose by pose.

    Raises
    ------
    ValueError
        When poses, table and noise do not determine a calibration; one sentence says why and what to do.

    Examples
    --------
    >>> trihedron.kalman(recording, gravity_m_s2=9.80665).calibration.accelerometer.S.shape
    (3, 3)
    """
    gravity, source, said = settle_gravity(gravity_m_s2, latitude_deg, height_m)
    recording = recording_of(recording)
    table = reference
    if table is not None and not isinstance(table, PoseTable | str | os.PathLike):
        raise WrongTypeError(f"a reference is a pose table or the name of its file, not {type(table).__name__}.")
    if isinstance(table, str | os.PathLike):
        table = read_pose_table(table, gravity_m_s2=gravity, sigma_angle_deg=sigma_angle_deg)
    given, noted, identified = _settle_noise(noise, recording)
    segments = segments_of(segments, recording, progress)
    if identified is not None and isinstance(given, Sequence):
        _check_adc(given, recording, segments)
    outcome: KalmanCalibration | NormKalmanCalibration
    if table is None:
        outcome = calibrate_session_without_references(
            recording, segments, gravity_m_s2=gravity, noise=given, frame=frame
        )
    else:
        outcome = calibrate_session(recording, segments, table, noise=given)
    if identified is not None:
        check_same_gravity(identified, outcome.accelerometer, gravity)
    findings = (*said, *noted, *recording.findings, *segments.findings, *outcome.findings)
    calibration = Calibration(
        accelerometer=outcome.accelerometer,
        gyroscope=None,
        covariance=outcome.accelerometer.covariance,
        frame=frame if table is None else "case",
        gravity_m_s2=gravity,
        gravity_source=source,
        recording_source=recording.source,
        recording_sha256=recording.sha256,
        findings=findings,
    )
    return KalmanResult(replace(outcome, findings=findings), calibration, segments, recording)


def _settle_noise(
    noise: NoiseSource | None, recording: Recording
) -> tuple[AxisNoise | Sequence[AxisNoise] | None, tuple[Finding, ...], Sequence[NoiseAxis] | None]:
    """Noise in raw units, findings of its identification, and the axes identified from a log."""
    if isinstance(noise, str | os.PathLike):
        if os.fspath(noise).lower().endswith(".json"):
            axes = read_noise_axes(noise)
            if not axes:
                return read_axis_noise(noise), (), None
            return noise_from_identified(axes, recording.accelerometer_unit), (), axes
        noise = _identify(read_recording(noise))
    if isinstance(noise, Noise):
        noticed = [*noise.findings, *(finding for axis in noise.axes for finding in axis.findings)]
        weighty = tuple(finding for finding in noticed if finding.severity is not Severity.NOTE)
        return noise_from_identified(noise.axes, recording.accelerometer_unit), weighty, noise.axes
    is_axes = isinstance(noise, Sequence) and all(isinstance(axis, AxisNoise) for axis in noise)
    if noise is not None and not isinstance(noise, AxisNoise) and not is_axes:
        raise WrongTypeError(f"noise is what trihedron.allan found, or the name of a file, not {type(noise).__name__}.")
    return noise, (), None


def _check_adc(given: Sequence[AxisNoise], recording: Recording, segments: Segments) -> None:
    """Raise where the noise is of a static log from another ADC."""
    readings = recording.accelerometer
    if readings is None or not segments.poses:
        return
    windows = [(pose.start, pose.stop) for pose in segments.poses if pose.stop - pose.start >= SHORTEST_POSE]
    if not windows:
        return
    inside = noise_of_poses(readings, recording.rate_hz, windows)
    # Codes between the poses count too: a coarse ADC shows a single code inside a pose.
    steps = recording.facts.of("accelerometer").step.tolist()
    octaves = [axis.octaves for axis in inside]
    check_same_adc(given, steps, octaves, recording.rate_hz, recording.source)


def _identify(rest: Recording) -> Noise:
    if rest.accelerometer is None:
        raise InputError(f"{rest.source}: there is no accelerometer whose noise could be identified in this log")
    unit = rest.accelerometer_unit.value
    names = ("accelerometer x", "accelerometer y", "accelerometer z")
    return identify_noise(rest.accelerometer, rest.rate_hz, names=names, units=(unit, unit, unit), source=rest.source)
