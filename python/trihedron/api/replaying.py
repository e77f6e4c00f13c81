"""A log replayed through the guide: its instructions pose by pose, then calibration and verification."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron.api.choices import settle_gravity
from trihedron.api.guiding import conclude, examine, part_of
from trihedron.api.reading import AnyRecording, recording_of
from trihedron.capture.guide import Guide
from trihedron.defaults import ACCURACY
from trihedron.errors import InputError
from trihedron.records import Recording
from trihedron.records.guiding import Accuracy, Examination, GuideView
from trihedron.records.results import CalibrationResult, VerificationResult

STEP_S = 0.25
"""Length of a block of a replayed log [s], as in a live session."""

OnPose = Callable[[GuideView], Any]


def guide(
    recording: AnyRecording,
    accuracy: str = ACCURACY,
    *,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
    on_pose: OnPose | None = None,
) -> tuple[CalibrationResult, VerificationResult | None]:
    """A guided session replayed from a log: calibrated when ``accuracy`` is reached, verified on the rest.

    Parameters
    ----------
    recording : Recording, or what trihedron.read takes
        Poses and moves.
    accuracy : str
        When to stop: ``"accel 0.05 %, gyro 0.1 %"``.
    gravity_m_s2 or latitude_deg, height_m : float
        As for :func:`calibrate`.
    on_pose : callable, optional
        Called with the guide's view (instruction, next pose, uncertainties) after every pose.

    Returns
    -------
    (CalibrationResult, VerificationResult or None)
        None where the log ends before poses to verify with.

    Raises
    ------
    ValueError
        When there is no accelerometer, the accuracy is not understood, or no calibration can be made.

    Examples
    --------
    >>> calibrated, checked = trihedron.guide("session.csv", "accel 0.1 %, gyro 0.2 %")  # doctest: +SKIP
    """
    wanted, gravity = Accuracy.parse(accuracy), settle_gravity(gravity_m_s2, latitude_deg, height_m)[0]
    _, used, cut_s = replay(recording_of(recording), wanted, gravity_m_s2=gravity, on_pose=on_pose)
    said = {"gravity_m_s2": gravity_m_s2, "latitude_deg": latitude_deg, "height_m": height_m}
    return conclude(used, cut_s, **said)


def replay(
    recording: Recording, wanted: Accuracy, *, gravity_m_s2: float, on_pose: OnPose | None = None
) -> tuple[GuideView, Recording, float | None]:
    """Final state of the guide on a log, block by block as in a live session, the part of the log that it used, and the
    start of its verification poses.

    Raises ``InputError`` when the log has no accelerometer.
    """
    readings = readings_of(recording)
    now_s = 0.0

    def so_far() -> Examination:
        return examine(part_of(recording, -math.inf, now_s + 1e-9), wanted, gravity_m_s2=gravity_m_s2)

    made = Guide(wanted, so_far)
    n_events = 0
    for first, last in steps(recording.time_s):
        now_s = float(recording.time_s[last - 1])
        view = made.advance(recording.time_s[first:last], readings[first:last])
        if view.n_events > n_events:
            n_events = view.n_events
            if on_pose is not None:
                on_pose(view)
        if made.is_done:
            break
    return made.finish(), part_of(recording, -math.inf, now_s + 1e-9), made.cut_s


def steps(time_s: npt.NDArray[np.float64]) -> Iterable[tuple[int, int]]:
    """Ranges of samples of about ``STEP_S``."""
    edges = np.searchsorted(time_s, np.arange(time_s[0], time_s[-1] + STEP_S, STEP_S))
    edges = np.unique([*edges, len(time_s)])
    return zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)


def readings_of(recording: Recording) -> npt.NDArray[np.float64]:
    """(n, 3) or (n, 6), the accelerometer first."""
    if recording.accelerometer is None:
        raise InputError(f"{recording.source}: a guide needs the accelerometer; this log has a gyro alone.")
    parts = [part for part in (recording.accelerometer, recording.gyroscope) if part is not None]
    return np.hstack(parts)
