"""Method 2: gyro calibration from hand moves between poses."""

from __future__ import annotations

import numpy as np

from trihedron.estimate.gyroscope.aligned_moves import measured_and_aligned
from trihedron.estimate.gyroscope.alignment import Aligned, MoveOptions, given_accelerometer
from trihedron.estimate.gyroscope.findings import findings_of
from trihedron.estimate.gyroscope.lost_turns import of_alignment
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.gyroscope.observability import describe
from trihedron.estimate.gyroscope.verification import Prediction, held_out, quality_of
from trihedron.records.calibration import SensorCalibration
from trihedron.records.finding import Finding
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments


def calibrate_moves(
    recording: Recording,
    segments: Segments,
    accelerometer: SensorCalibration,
    gravity_m_s2: float,
    options: MoveOptions | None = None,
) -> tuple[SensorCalibration, tuple[Finding, ...]]:
    """Calibrate the gyro so that its integrated moves carry each pose's gravity into the next (equations 5.1-5.9).

    Parameters
    ----------
    recording : Recording
        Raw readings of both sensors.
    segments : Segments
        Its poses and moves.
    accelerometer : SensorCalibration
        Calibrated accelerometer: its frame becomes the gyro's, its covariance enters the gyro's.
    gravity_m_s2 : float
        Magnitude of gravity, m/s².
    options : MoveOptions
        Rate model, screening, folds.

    Returns
    -------
    SensorCalibration, tuple of Finding
        ``ω = S raw + b`` in rad/s, and what was noticed.

    Raises
    ------
    ValueError
        When a sensor or every move is missing, or nothing tells the scale to start from.
    """
    options = options or MoveOptions()
    part = given_accelerometer(accelerometer)
    measured, aligned, options = measured_and_aligned(recording, segments, part, gravity_m_s2, options)
    held = held_out(aligned, measured, part, gravity_m_s2, options)
    aligned, of_losses = of_alignment(recording.time_s, measured, aligned, gravity_m_s2)
    found = (*findings_of(aligned, measured, held), *of_losses)
    return gyroscope_of(aligned, measured, recording, gravity_m_s2, held, "moves"), found


def gyroscope_of(
    aligned: Aligned,
    measured: MoveMeasurements,
    recording: Recording,
    gravity_m_s2: float,
    held: Prediction | None,
    method: str,
) -> SensorCalibration:
    """The gyro's record from an alignment."""
    S = np.asarray(aligned.fit.gyroscope_scale)
    return SensorCalibration(
        S=S,
        b=aligned.gyroscope_bias,
        covariance=aligned.covariance[12:, 12:],
        raw_unit=recording.gyroscope_unit.value,
        si_unit="rad/s",
        method=method,
        quality=quality_of(aligned, measured, gravity_m_s2, held),
        observability=describe(aligned.fit, aligned.covariance[12:21, 12:21], S, aligned.n_gyroscope),
    )
