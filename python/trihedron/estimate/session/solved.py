"""A recording's session solved: from the moves alone to both sensors and the certainty of both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.gyroscope.aligned_moves import measured_and_aligned
from trihedron.estimate.gyroscope.alignment import AccelerometerPart, Aligned, MoveOptions, given_accelerometer
from trihedron.estimate.gyroscope.findings import findings_of
from trihedron.estimate.gyroscope.lost_turns import (
    PossibleLosses,
    is_asked_for_losses,
    losses_that_fit,
    relative_sigma,
)
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.gyroscope.observability import describe
from trihedron.estimate.session.carried import Carried, HeldOut, carried, held_out, move_quality
from trihedron.estimate.session.fit import SessionSolution, far_moves, refitted, solve_session
from trihedron.estimate.session.observed import Observed, arranged, with_prior
from trihedron.records.calibration import SensorCalibration
from trihedron.records.finding import Finding
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments
from trihedron.sensor_model import reframing
from trihedron.session.averaging import sharpened
from trihedron.session.rounding import plateau_variance, shared_errors


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


_Near = tuple[FloatArray, FloatArray, FloatArray]
HIDDEN_S = 0.01 * 2.0 ** np.arange(7)
"""Turns that are tried, in seconds of a rate of one LSB: what settles unseen stays below it for tenths of a second."""


@dataclass(frozen=True, eq=False)
class SolvedSession:
    """A session at its optimum, in the lower frame.

    ``covariance`` (24, 24) with all that is charged to its parameters; ``gyroscope``'s record and ``held_out``
    predictions follow from it; ``findings`` are those of the moves.
    """

    observed: Observed
    solution: SessionSolution
    covariance: FloatArray
    gyroscope: SensorCalibration
    held_out: HeldOut | None
    findings: tuple[Finding, ...]
    averaging: float


@dataclass(frozen=True, eq=False)
class _Log:
    """What a session is solved from."""

    recording: Recording
    segments: Segments
    part: AccelerometerPart
    gravity_m_s2: float

    def observed(self, measured: MoveMeasurements, aligned: Aligned, near: _Near) -> Observed:
        """The session, ``near`` (S_a, b_a, S_w)."""
        out = arranged(self.recording, self.segments, measured, self.gravity_m_s2, aligned.used)
        return with_prior(out, *near, is_given=self.part.is_given)


def solved(
    recording: Recording, segments: Segments, part: AccelerometerPart, gravity_m_s2: float, options: MoveOptions
) -> SolvedSession:
    """The session model from where the moves alone stand (docs/model-session.md), an accelerometer that is given held.

    Raises
    ------
    ValueError
        When a sensor or every move is missing, or nothing tells the scale to start from.
    """
    measured, aligned, options = measured_and_aligned(recording, segments, part, gravity_m_s2, options)
    log = _Log(recording, segments, part, gravity_m_s2)
    fit, model = aligned.fit, part.model
    own = (model.S, model.b) if part.is_given else (np.asarray(fit.accelerometer_scale), fit.accelerometer_bias)
    S_a, b_a, R = _lower(*own)
    near = S_a, b_a, R @ np.asarray(fit.gyroscope_scale)
    measured = _with_hidden_turns(log, measured, aligned, near)
    while True:
        observed = log.observed(measured, aligned, near)
        solution = solve_session(observed, *near)
        fewer = _without_far_moves(aligned, measured, observed, solution)
        if fewer is None:
            break
        # One move that was knocked would be shared out among all as if each were so uncertain.
        aligned = fewer
    anchors = segments.time_mid_s[measured.links]
    shown = solution.as_read(measured)
    seen = carried(shown, anchors, solution.S_a, solution.b_a, solution.S_w)
    left_out = held_out(observed, shown, anchors, solution, options.n_folds)
    covariance = solution.covariance + _by_readings(log, measured, aligned, solution, near)
    if measured.attitude is not None:
        more = solution.S_w @ np.diag(measured.attitude.var_bias) @ solution.S_w.T
        covariance[21:, 21:] += np.diag(np.maximum(np.diag(more) - np.diag(covariance[21:, 21:]), 0.0))
    losses = _losses(log, measured, aligned, solution, seen)
    own_sigma = relative_sigma(covariance[12:, 12:], solution.S_w)
    covariance[12:, 12:] = losses.widened(covariance[12:, 12:], solution.S_w, solution.b_w, solution.inflation[0] ** 2)
    gyroscope = SensorCalibration(
        S=solution.S_w,
        b=solution.b_w,
        covariance=covariance[12:, 12:],
        raw_unit=recording.gyroscope_unit.value,
        si_unit="rad/s",
        method="moves" if part.is_given else "joint",
        quality=move_quality(
            measured, solution, seen, None if left_out is None else left_out.moves, np.where(aligned.used, 1.0, 0.0)
        ),
        observability=describe(aligned.fit, covariance[12:21, 12:21], solution.S_w, aligned.n_gyroscope),
    )
    found = findings_of(aligned, measured, solution, gyroscope, seen)
    return SolvedSession(
        observed, solution, covariance, gyroscope, left_out, (*found, *losses.findings(own_sigma)),
        measured.averaging.share,
    )  # fmt: skip


def _with_hidden_turns(log: _Log, measured: MoveMeasurements, aligned: Aligned, near: _Near) -> MoveMeasurements:
    """Every move with a turn that its LSB hides, as a support makes that settles, of the rms that is likeliest.

    Where samples may have been lost unseen these are asked for first: they would be as good a reason for the misses.
    """
    if not np.any(measured.is_undithered):
        return measured
    plain = solve_session(log.observed(measured, aligned, near), *near)
    if is_asked_for_losses(log.recording.time_s, measured, aligned, plain.moves_chi2, plain.moves_dof):
        return measured
    known = np.zeros(measured.rate.shape) if measured.reading_variance is None else measured.reading_variance
    shared = plateau_variance(*measured.coarse(log.recording, log.segments))
    if shared is not None:
        # Moves agree among themselves: what they share where their rate stands still inside a step.
        known = np.maximum(known, shared[measured.rows])
        measured = replace(measured, reading_variance=known)
        plain = solve_session(log.observed(measured, aligned, near), *near)
    best, likeliest = measured, plain.core.log_marginal
    for hidden_s in HIDDEN_S:
        variance = known.copy()
        variance[measured.edges[:, 1] - 2] += (hidden_s / measured.nominal_step_s * measured.quantum.max()) ** 2
        tried = replace(measured, reading_variance=variance)
        found = solve_session(log.observed(tried, aligned, near), *near).core.log_marginal
        if found <= likeliest:
            break
        best, likeliest = tried, found
    return best


def in_frame_of(part: AccelerometerPart, found: SolvedSession) -> SensorCalibration:
    """The gyro in the frame of the accelerometer that was given, whose own errors are in its covariance.

    Each of the accelerometer's standard errors turns the frame and moves what the session is held to.
    """
    model = part.model
    R = _lower(model.S, model.b)[2].T
    to_frame = np.zeros((12, 12))
    to_frame[:9, :9], to_frame[9:, 9:] = np.kron(R, np.eye(3)), R
    S, b = R @ found.solution.S_w, R @ found.solution.b_w
    covariance = to_frame @ found.gyroscope.covariance @ to_frame.T
    for direction in part.basis.T:
        S_a, b_a, into = _lower(model.S + direction[:9].reshape(3, 3), model.b + direction[9:])
        observed = with_prior(found.observed, S_a, b_a, found.solution.S_w, is_given=True)
        other = refitted(observed, found.solution)
        off = np.concatenate([(into.T @ other.S_w - S).ravel(), into.T @ other.b_w - b])
        covariance += np.outer(off, off)
    return replace(found.gyroscope, S=S, b=b, covariance=covariance)


def _lower(S: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """An accelerometer in the lower frame, and the rotation (3, 3) into it."""
    R = reframing(S, b, "lower").rotation
    return np.tril(R @ S), R @ b, R


def _losses(
    log: _Log, measured: MoveMeasurements, aligned: Aligned, solution: SessionSolution, seen: Carried
) -> PossibleLosses:
    """Samples lost unseen that may be behind what the moves miss."""
    time_s, chi2, dof = log.recording.time_s, solution.moves_chi2, solution.moves_dof
    if not is_asked_for_losses(time_s, measured, aligned, chi2, dof):
        return PossibleLosses()
    missed = seen.angle_deg, seen.floor2
    return losses_that_fit(time_s, measured, solution.S_w, log.gravity_m_s2, missed, dof, aligned.used)


def _by_readings(
    log: _Log, measured: MoveMeasurements, aligned: Aligned, solution: SessionSolution, near: _Near
) -> FloatArray:
    """Covariance (24, 24) by what all moves share: what is not known of the sensor's averaging, and what its steps hide
    in common. Readings off by one standard error, fitted anew.
    """
    found = measured.averaging
    rate = sharpened(measured.rate, measured.time_s, found.sigma)
    others = [replace(measured, rate=rate, averaging=replace(found, share=found.share + found.sigma))]
    if np.any(measured.is_undithered):
        errors = shared_errors(*measured.coarse(log.recording, log.segments))
        others += [replace(measured, rate=measured.rate + error[measured.rows]) for error in errors]
    fits = [refitted(log.observed(one, aligned, near), solution) for one in others]
    along = np.array([fit.parameters for fit in fits]) - solution.parameters
    return along.T @ along


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
