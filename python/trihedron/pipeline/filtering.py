"""Calibrate by Kalman filter: in known attitudes where there is a pose table, by the length of gravity otherwise."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

from trihedron.estimate.kalman import NormFrame, calibrate_session, calibrate_session_without_references
from trihedron.pipeline.choices import settle_gravity
from trihedron.pipeline.reading import Progress, segment
from trihedron.read import read_axis_noise, read_pose_table
from trihedron.records import (
    AxisNoise,
    Calibration,
    Finding,
    KalmanCalibration,
    NormKalmanCalibration,
    PoseTable,
    Recording,
    Segments,
    Severity,
)


@dataclass(frozen=True, eq=False, repr=False)
class KalmanResult:
    """What the filter found, with the segments and the recording that it was made from. ``print`` gives the report."""

    outcome: KalmanCalibration | NormKalmanCalibration
    calibration: Calibration
    segments: Segments
    recording: Recording

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Everything noticed, by every stage."""
        return self.calibration.findings

    @property
    def is_trustworthy(self) -> bool:
        """No serious finding."""
        return not any(finding.severity is Severity.SERIOUS for finding in self.findings)

    def __repr__(self) -> str:
        return f"<KalmanResult of {self.recording.source}: {self.calibration.accelerometer.method}>"

    def __str__(self) -> str:
        from trihedron.report import kalman_report, to_text

        return to_text(kalman_report(self.outcome, self.calibration))


def kalman(
    recording: Recording,
    reference: PoseTable | str | os.PathLike[str] | None = None,
    *,
    segments: Segments | None = None,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
    sigma_angle_deg: float = 0.0,
    noise: AxisNoise | Sequence[AxisNoise] | str | os.PathLike[str] | None = None,
    frame: NormFrame = "lower",
    progress: Progress | None = None,
) -> KalmanResult:
    """Calibrate the accelerometer by Kalman filter with its noise in the state (docs/kalman.md).

    Parameters
    ----------
    recording : Recording
        As :func:`trihedron.read` gives it.
    reference : PoseTable or file, optional
        Attitudes of the still poses: pitch and roll, or directions. Without it the length of gravity must do.
    sigma_angle_deg : float
        Standard error of the angles in the file.
    noise : AxisNoise, three of them, or file
        Noise of the raw readings; without it, what is seen inside the still poses.
    frame : "lower" or "symmetric"
        Instrument trihedron where there is no reference; with one it is the frame of the reference.

    Raises
    ------
    ValueError
        When the question cannot be answered; one sentence says why and what to do.
    """
    gravity, source, said = settle_gravity(gravity_m_s2, latitude_deg, height_m)
    table = reference
    if isinstance(table, str | os.PathLike):
        table = read_pose_table(table, gravity_m_s2=gravity, sigma_angle_deg=sigma_angle_deg)
    if isinstance(noise, str | os.PathLike):
        noise = read_axis_noise(noise)
    segments = segment(recording, progress=progress) if segments is None else segments
    outcome: KalmanCalibration | NormKalmanCalibration
    if table is None:
        outcome = calibrate_session_without_references(
            recording, segments, gravity_m_s2=gravity, noise=noise, frame=frame
        )
    else:
        outcome = calibrate_session(recording, segments, table, noise=noise)
    findings = (*said, *recording.findings, *segments.findings, *outcome.findings)
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
