"""Method 2: gyro calibration from hand moves between poses."""

from __future__ import annotations

from trihedron.estimate.gyroscope.alignment import MoveOptions, given_accelerometer
from trihedron.estimate.session.solved import in_frame_of, solved
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
    part = given_accelerometer(accelerometer)
    found = solved(recording, segments, part, gravity_m_s2, options or MoveOptions())
    return in_frame_of(part, found), found.findings
