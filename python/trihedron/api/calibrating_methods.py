"""The methods of calibration: any poses, both sensors in one fit or one after the other; faces of a square case."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, get_args

import numpy as np

from trihedron.errors import INPUT_ERRORS
from trihedron.estimate.accelerometer.face_poses import faces_up, shared_rounding
from trihedron.estimate.accelerometer.faces import calibrate_faces
from trihedron.estimate.accelerometer.norm import calibrate_norm
from trihedron.estimate.case_session import in_case_frame
from trihedron.estimate.gyroscope.stated_turns import (
    TableTurns,
    by_quarters,
    on_stated_turns,
    scale_of_stated,
    table_turns,
)
from trihedron.estimate.session.solved import calibrate_joint, calibrate_moves
from trihedron.estimate.session.start import GyroClippedError
from trihedron.records import Calibration, Finding, Frame, Recording, Segments, SensorCalibration
from trihedron.records.words import words

Method = Literal["joint", "separate", "faces"]
METHODS: tuple[Method, ...] = get_args(Method)

Found = tuple[Finding, ...]


@dataclass(frozen=True, eq=False)
class LogOfPoses:
    """What every method starts from; ``nominal`` is the gyro's scale [rad/s per unit]."""

    recording: Recording
    segments: Segments
    gravity: float
    source: str
    nominal: float | None

    def by_poses(self, method: Method, axis_signs: Sequence[int] | None) -> Calibration:
        recording, segments, gravity = self.recording, self.segments, self.gravity
        assert segments.accelerometer_mean is not None
        assert segments.norm_sigma is not None
        accelerometer, found = calibrate_norm(
            segments.accelerometer_mean,
            segments.norm_sigma,
            gravity,
            raw_unit=recording.accelerometer_unit,
            axis_signs=axis_signs,
        )
        alone = self._alone(accelerometer, found, "lower")
        if recording.gyroscope is None:
            return alone
        try:
            # Moves do not refine an accelerometer with a serious finding: its error adds to the gyro's uncertainties.
            if method == "joint" and alone.is_trustworthy:
                return calibrate_joint(recording, segments, alone, self.nominal)
            gyroscope, more = calibrate_moves(recording, segments, accelerometer, gravity, self.nominal)
        except INPUT_ERRORS as error:
            return _without_gyroscope(alone, error)
        # Fitted separately: the gyro's covariance includes the accelerometer's error.
        covariance = np.zeros((24, 24))
        covariance[:12, :12], covariance[12:, 12:] = accelerometer.covariance, gyroscope.covariance
        return replace(alone, gyroscope=gyroscope, covariance=covariance, findings=(*found, *more))

    def by_faces(self, faces: Sequence[int] | None, turns_deg: Sequence[float] | None) -> Calibration:
        recording, segments = self.recording, self.segments
        mean, sigma_mean, sigma = segments.accelerometer_mean, segments.accelerometer_sigma_mean, segments.norm_sigma
        unit = recording.accelerometer_unit
        assert mean is not None
        assert sigma_mean is not None
        up = faces_up(mean, unit, faces)
        shared = shared_rounding(segments, recording.facts.of("accelerometer").step)
        by_faces = partial(calibrate_faces, mean, sigma_mean, self.gravity, up=faces, raw_unit=unit, shared=shared)
        try:
            accelerometer, found = by_faces()
        except INPUT_ERRORS:
            if recording.gyroscope is None or turns_deg is None or sigma is None:
                raise
            # Stated turns about stated faces determine the gyro even without a full accelerometer.
            accelerometer, _ = by_faces(is_square=True)
            _, found = calibrate_norm(mean, sigma, self.gravity, raw_unit=unit)
        alone = self._alone(accelerometer, found, "case")
        if recording.gyroscope is None:
            return alone
        # The lean of the table is found anew beside moves.
        found = tuple(one for one in found if one.code != "table-tilt")
        try:
            stated = None
            if turns_deg is not None:
                stated = scale_of_stated(table_turns(recording, segments, accelerometer, turns_deg))
            # Residuals of faces are leans of the table, which poses and moves do not have.
            near = replace(alone, accelerometer=replace(accelerometer, quality=None), findings=found)
            session = replace(calibrate_joint(recording, segments, near, self.nominal, stated), frame="lower")
            return in_case_frame(*on_turns(session, recording, segments, turns_deg), recording, segments, up)
        except INPUT_ERRORS as error:
            if turns_deg is not None:
                raise
            return _without_gyroscope(alone, error)

    def _alone(self, accelerometer: SensorCalibration, found: Found, frame: Frame) -> Calibration:
        of_log = (self.gravity, self.source, self.recording.source, self.recording.sha256)
        return Calibration(accelerometer, None, accelerometer.covariance, frame, *of_log, findings=found)


def on_turns(
    session: Calibration, recording: Recording, segments: Segments, turns_deg: Sequence[float] | None
) -> tuple[Calibration, TableTurns]:
    """The calibration of poses and moves updated with turns on a table, and these; multiples of 90° where the user
    states no angles."""
    assert session.gyroscope is not None
    turns = table_turns(recording, segments, session.accelerometer, turns_deg)
    if turns_deg is None:
        turns, said = by_quarters(turns, session)
        session = replace(session, findings=(*session.findings, *said))
    return on_stated_turns(session, recording, segments, turns) if turns.moves else (session, turns)


def _without_gyroscope(alone: Calibration, error: Exception) -> Calibration:
    if isinstance(error, GyroClippedError):
        finding = Finding.of("gyroscope-left-out", "clipped", n_lost=error.n_lost, n_moves=error.n_moves)
    else:
        why = words("because", sentence=str(error))
        finding = Finding.of("gyroscope-left-out", "not-calibrated", why=why)
    return replace(alone, findings=(*alone.findings, finding))
