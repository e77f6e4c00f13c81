"""Both sensors in one fit: the reference answer, with the covariance of all 24 parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron import probability
from trihedron.arrays import FloatArray
from trihedron.estimate.accelerometer.verdict import covariance_scale
from trihedron.estimate.gyroscope.alignment import AccelerometerPart, MoveOptions
from trihedron.estimate.session.carried import norm_quality
from trihedron.estimate.session.fit import SessionSolution
from trihedron.estimate.session.solved import solved
from trihedron.records.calibration import Calibration, FitQuality, Frame, SensorCalibration
from trihedron.records.finding import Finding, FindingCode
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments
from trihedron.sensor_model import in_frame

FALSE_ALARM = 1e-3
"""Chance that a sound recording is taken for one whose moves contradict its poses."""


def pull_allowed(alone: SensorCalibration) -> float:
    """Limit of that rise; where the norms alone exceed their noise, χ² counts in units of that excess (F test)."""
    quality = alone.quality
    if quality is None or quality.dof < 1 or probability.chdtrc(quality.dof, quality.chi2) >= 0.01:
        return float(probability.chdtri(9, FALSE_ALARM))
    return float(9.0 * quality.chi2 / quality.dof * probability.fdtri(9, quality.dof, 1.0 - FALSE_ALARM))


def pull_on_accelerometer(alone: SensorCalibration, joint: SensorCalibration) -> float:
    """By how much the moves raise χ² of the poses' norms: χ² with at most 9 degrees of freedom if both agree.

    A bias that drifts raises it, and contradicts nothing: it counts in units of what one bias for the session misses.
    """
    if alone.quality is None or joint.quality is None:
        return 0.0
    return (joint.quality.chi2 - alone.quality.chi2) / joint.quality.covariance_scale


def calibrate_joint(
    recording: Recording,
    segments: Segments,
    accelerometer: SensorCalibration,
    gravity_m_s2: float,
    gravity_source: str,
    options: MoveOptions | None = None,
) -> Calibration:
    """Fit ``S_f, b_f, S_ω`` to the norm of every pose and the rotation of every move at once (equations 5.7, 5.8).

    The noise of a pose's mean enters its norm and both neighbouring moves, with its full covariance. The frame is that
    of ``accelerometer``, which is also the start: nothing in the data turns the trihedron as a whole.

    Parameters
    ----------
    recording, segments : Recording, Segments
        Raw readings of both sensors, their poses and moves.
    accelerometer : SensorCalibration
        Solution of the accelerometer alone (its quality tells how far its residual exceeds the noise).
    gravity_m_s2, gravity_source : float, str
        Magnitude of gravity and where it comes from.
    options : MoveOptions
        As for method 2.

    Raises
    ------
    ValueError
        As :func:`trihedron.estimate.gyroscope.calibrate_moves`.
    """
    basis, frame = free_directions(accelerometer.S)
    part = AccelerometerPart(accelerometer, basis, is_given=False)
    found = solved(recording, segments, part, gravity_m_s2, options or MoveOptions())
    solution, left_out, alone = found.solution, found.held_out, accelerometer.quality
    held = (None, None) if left_out is None else (left_out.norm, left_out.norm_sigma)
    quality = norm_quality(found.observed, solution, *held)
    if left_out is None and alone is not None:
        quality = replace(
            quality, held_out=alone.held_out, held_out_sigma=alone.held_out_sigma, held_out_rms=alone.held_out_rms
        )
    both = Calibration(
        accelerometer=SensorCalibration(
            S=solution.S_a,
            b=solution.b_a,
            covariance=found.covariance[:12, :12],
            raw_unit=accelerometer.raw_unit,
            si_unit=accelerometer.si_unit,
            method="joint",
            quality=quality,
            observability=accelerometer.observability,
        ),
        gyroscope=found.gyroscope,
        covariance=found.covariance,
        frame="lower",
        gravity_m_s2=gravity_m_s2,
        gravity_source=gravity_source,
        recording_source=recording.source,
        recording_sha256=recording.sha256,
        findings=(*_poses_above_noise(quality, solution), *found.findings),
        averaging=found.averaging,
    )
    return in_frame(both, frame)


def _poses_above_noise(quality: FitQuality, solution: SessionSolution) -> tuple[Finding, ...]:
    """Gravity at rest, missed by more than the noise of the means: what the session fit makes of that."""
    if covariance_scale(quality.chi2, quality.dof) == 1.0:
        return ()
    return (
        Finding.of(
            FindingCode.RESIDUAL_ABOVE_NOISE,
            "poses-joint",
            rms_m_s2=quality.rms,
            floor_m_s2=quality.floor,
            chi2_per_dof=quality.chi2 / quality.dof,
            dof=quality.dof,
            bias_repeatability_m_s2=solution.accel_bias_rms,
        ),
    )


def free_directions(S: FloatArray) -> tuple[FloatArray, Frame]:
    """Directions (12, 9) in ``(S row by row, b)`` that do not turn the frame of ``S``, and that frame.

    Lower triangular: its six elements. Otherwise ``S = U P`` with ``P`` symmetric (polar factors) keeps ``U``, and
    ``δS = U δP``: with ``U = 1`` that is the symmetric frame, with any other the case frame as it was given.
    """
    size = float(np.linalg.norm(S, 2))
    directions = []
    frame: Frame
    if np.abs(np.triu(S, 1)).max() <= 1e-12 * size:
        frame = "lower"
        for i in range(3):
            for j in range(i + 1):
                direction = np.zeros((3, 3))
                direction[i, j] = 1.0
                directions.append(direction)
    else:
        left, _, right = np.linalg.svd(S)
        U = left @ right
        frame = "symmetric" if np.abs(S - S.T).max() <= 1e-9 * size else "case"
        for i in range(3):
            for j in range(i + 1):
                direction = np.zeros((3, 3))
                direction[i, j] = direction[j, i] = 1.0
                directions.append(U @ direction)
    basis = np.zeros((12, 9))
    for column, direction in enumerate(directions):
        basis[:9, column] = direction.ravel()
    basis[9:, 6:] = np.eye(3)
    return basis, frame
