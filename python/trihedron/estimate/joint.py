"""Both sensors in one fit: the reference answer, with the covariance of all 24 parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.accelerometer.verdict import covariance_scale
from trihedron.estimate.gyroscope.aligned_moves import measured_and_aligned
from trihedron.estimate.gyroscope.alignment import AccelerometerPart, Aligned, MoveOptions
from trihedron.estimate.gyroscope.findings import findings_of
from trihedron.estimate.gyroscope.lost_turns import (
    PossibleLosses,
    is_asked_for_losses,
    losses_that_fit,
    of_alignment,
    relative_sigma,
)
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.gyroscope.moves import gyroscope_of
from trihedron.estimate.gyroscope.observability import describe
from trihedron.estimate.gyroscope.verification import held_out
from trihedron.estimate.session.carried import carried
from trihedron.estimate.session.figures import held_out as held_out_of_session
from trihedron.estimate.session.figures import move_quality, norm_quality
from trihedron.estimate.session.fit import SessionSolution, far_moves, refitted, solve_session
from trihedron.estimate.session.observed import Observed, arranged
from trihedron.records.calibration import Calibration, FitQuality, Frame, SensorCalibration
from trihedron.records.finding import Finding, FindingCode
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments
from trihedron.records.words import words
from trihedron.sensor_model import in_frame, reframing
from trihedron.session.averaging import sharpened


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
    options = options or MoveOptions()
    basis, frame = free_directions(accelerometer.S)
    part = AccelerometerPart(accelerometer, basis, is_given=False)
    measured, aligned, options = measured_and_aligned(recording, segments, part, gravity_m_s2, options)
    is_determined = aligned.fit.rank == len(aligned.fit.singular_values)
    if frame == "case" or options.is_offset_free or not is_determined:
        # Moves that leave directions open, or a bias hidden inside an LSB: the moves alone are judged.
        return _by_moves_alone(recording, measured, accelerometer, part, aligned, options, gravity_m_s2, gravity_source)
    answer = _by_session(recording, segments, measured, accelerometer, aligned, options, gravity_m_s2, gravity_source)
    return in_frame(answer, frame)


def _by_session(
    recording: Recording,
    segments: Segments,
    measured: MoveMeasurements,
    accelerometer: SensorCalibration,
    aligned: Aligned,
    options: MoveOptions,
    gravity_m_s2: float,
    gravity_source: str,
) -> Calibration:
    """The session model from where the moves alone stand, in the lower frame (docs/model-session.md)."""
    S_start, b_start = np.asarray(aligned.fit.accelerometer_scale), np.asarray(aligned.fit.accelerometer_bias)
    R = reframing(S_start, b_start, "lower").rotation
    start = np.tril(R @ S_start), R @ b_start, R @ np.asarray(aligned.fit.gyroscope_scale)
    while True:
        observed = arranged(recording, segments, measured, gravity_m_s2, aligned.used)
        solution = solve_session(observed, *start)
        fewer = _without_far_moves(aligned, measured, observed, solution)
        if fewer is None:
            break
        # One move that was knocked would be shared out among all as if each were so uncertain.
        aligned = fewer
    anchors = segments.time_mid_s[measured.links]
    seen = carried(measured, anchors, solution.S_a, solution.b_a, solution.S_w)
    left_out = held_out_of_session(observed, measured, anchors, solution, options.n_folds)
    covariance = solution.covariance + _by_averaging(recording, segments, measured, aligned, gravity_m_s2, solution)
    if measured.attitude is not None:
        more = solution.S_w @ np.diag(measured.attitude.var_bias) @ solution.S_w.T
        covariance[21:, 21:] += np.diag(np.maximum(np.diag(more) - np.diag(covariance[21:, 21:]), 0.0))
    own_sigma = relative_sigma(covariance[12:, 12:], solution.S_w)
    losses = PossibleLosses()
    if is_asked_for_losses(recording.time_s, measured, aligned, solution.moves_chi2, solution.moves_dof):
        missed = seen.angle_deg, seen.floor2
        losses = losses_that_fit(
            recording.time_s, measured, solution.S_w, gravity_m_s2, missed, solution.moves_dof, aligned.used
        )
    covariance[12:, 12:] = losses.widened(covariance[12:, 12:], solution.S_w, solution.b_w, solution.inflation[0] ** 2)
    used = np.where(aligned.used, 1.0, 0.0)
    held = None if left_out is None else left_out.norm
    alone = accelerometer.quality
    quality = norm_quality(observed, solution, held, None if left_out is None else left_out.norm_sigma)
    if left_out is None and alone is not None:
        quality = replace(
            quality, held_out=alone.held_out, held_out_sigma=alone.held_out_sigma, held_out_rms=alone.held_out_rms
        )
    gyroscope = SensorCalibration(
        S=solution.S_w,
        b=solution.b_w,
        covariance=covariance[12:, 12:],
        raw_unit=recording.gyroscope_unit.value,
        si_unit="rad/s",
        method="joint",
        quality=move_quality(measured, solution, seen, None if left_out is None else left_out.moves, used),
        observability=describe(aligned.fit, covariance[12:21, 12:21], solution.S_w, aligned.n_gyroscope),
    )
    return Calibration(
        accelerometer=SensorCalibration(
            S=solution.S_a,
            b=solution.b_a,
            covariance=covariance[:12, :12],
            raw_unit=accelerometer.raw_unit,
            si_unit=accelerometer.si_unit,
            method="joint",
            quality=quality,
            observability=accelerometer.observability,
        ),
        gyroscope=gyroscope,
        covariance=covariance,
        frame="lower",
        gravity_m_s2=gravity_m_s2,
        gravity_source=gravity_source,
        recording_source=recording.source,
        recording_sha256=recording.sha256,
        findings=(
            *_poses_above_noise(quality, solution),
            *_findings(aligned, measured, solution),
            *losses.findings(own_sigma),
        ),
        averaging=measured.averaging.share,
    )


def _by_averaging(
    recording: Recording,
    segments: Segments,
    measured: MoveMeasurements,
    aligned: Aligned,
    gravity_m_s2: float,
    solution: SessionSolution,
) -> FloatArray:
    """Covariance (24, 24) by what is not known of the sensor's averaging: a step of one standard error, fitted anew."""
    found = measured.averaging
    more = replace(
        measured,
        rate=sharpened(measured.rate, measured.time_s, found.sigma),
        averaging=replace(found, share=found.share + found.sigma),
    )
    observed = arranged(recording, segments, more, gravity_m_s2, aligned.used)
    along = refitted(observed, solution).parameters - solution.parameters
    return np.outer(along, along)


def _without_far_moves(
    aligned: Aligned, measured: MoveMeasurements, observed: Observed, solution: SessionSolution
) -> Aligned | None:
    """The alignment without moves that the session's fit shows to be outliers; ``None`` where none is, or too few
    would be left to judge them by.
    """
    far = np.isin(measured.links[:, 0], observed.before[far_moves(solution, len(observed.before))]) & aligned.used
    used = aligned.used & ~far
    if not np.any(far) or 2 * int(np.count_nonzero(used)) <= min(9, aligned.fit.rank) + 2:
        return None
    return replace(aligned, used=used, outliers=tuple(sorted((*aligned.outliers, *map(int, np.flatnonzero(far))))))


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


def _findings(aligned: Aligned, measured: MoveMeasurements, solution: SessionSolution) -> tuple[Finding, ...]:
    """What the moves showed, with the end of the fit and the widening of the noise as the session has them."""
    about_fit = (FindingCode.NOT_CONVERGED, FindingCode.RESIDUAL_ABOVE_NOISE)
    found = [one for one in findings_of(aligned, measured, None) if one.code not in about_fit]
    if not solution.is_converged:
        found.append(Finding.of(FindingCode.NOT_CONVERGED, "session", stopped_because=solution.stopped_because))
    if solution.inflation[0] > 1.0:
        found.append(
            Finding.of(
                FindingCode.RESIDUAL_ABOVE_NOISE,
                "moves-joint",
                chi2_per_dof=solution.moves_chi2 / max(solution.moves_dof, 1.0),
                dof=solution.moves_dof,
            )
        )
    return tuple(found)


def _by_moves_alone(
    recording: Recording,
    measured: MoveMeasurements,
    accelerometer: SensorCalibration,
    part: AccelerometerPart,
    aligned: Aligned,
    options: MoveOptions,
    gravity_m_s2: float,
    gravity_source: str,
) -> Calibration:
    held = held_out(aligned, measured, part, gravity_m_s2, options)
    aligned, of_losses = of_alignment(recording.time_s, measured, aligned, gravity_m_s2)
    return Calibration(
        accelerometer=SensorCalibration(
            S=np.asarray(aligned.fit.accelerometer_scale),
            b=np.asarray(aligned.fit.accelerometer_bias),
            covariance=aligned.covariance[:12, :12],
            raw_unit=accelerometer.raw_unit,
            si_unit=accelerometer.si_unit,
            method="joint",
            quality=_norm_quality(aligned, measured, accelerometer.quality, gravity_m_s2, part.basis.shape[1]),
            observability=accelerometer.observability,
        ),
        gyroscope=gyroscope_of(aligned, measured, recording, gravity_m_s2, held, "joint"),
        covariance=aligned.covariance,
        frame=free_directions(accelerometer.S)[1],
        gravity_m_s2=gravity_m_s2,
        gravity_source=gravity_source,
        recording_source=recording.source,
        recording_sha256=recording.sha256,
        findings=(*findings_of(aligned, measured, held), *of_losses),
        averaging=measured.averaging.share,
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


def _norm_quality(
    aligned: Aligned,
    measured: MoveMeasurements,
    alone: FitQuality | None,
    gravity_m_s2: float,
    n_parameters: int,
) -> FitQuality:
    """Norm residual of every pose at the joint solution; what was held out stays that of the accelerometer alone."""
    S = np.asarray(aligned.fit.accelerometer_scale)
    force = measured.reading @ S.T + np.asarray(aligned.fit.accelerometer_bias)
    norm = np.linalg.norm(force, axis=1)
    residual = norm - gravity_m_s2
    gain = (force / norm[:, None]) @ S
    sigma = np.sqrt(np.sum(gain**2 * measured.var_reading, axis=1))
    dof = max(len(residual) - n_parameters, 0)
    total = float(np.sum(residual**2))
    quality = FitQuality(
        unit="m/s^2",
        residual=residual,
        sigma=sigma,
        chi2=float(np.sum((residual / np.maximum(sigma, 1e-300)) ** 2)),
        dof=dof,
        rms=float(np.sqrt(total / len(residual))),
        rms_dof=float(np.sqrt(total / dof)) if dof else float("nan"),
        floor=float(np.sqrt(np.mean(sigma**2))),
        n_iterations=aligned.fit.iterations,
        stopped_because=words(aligned.fit.stopped_because),
    )
    if alone is None:
        return quality
    return replace(
        quality,
        held_out=alone.held_out,
        held_out_sigma=alone.held_out_sigma,
        held_out_rms=alone.held_out_rms,
        # The noise of the poses was widened by it before the fit.
        covariance_scale=alone.covariance_scale,
    )
