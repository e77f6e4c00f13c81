"""A recording's session solved: from the moves alone to both sensors and the certainty of both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.gyroscope.findings import findings_of
from trihedron.estimate.gyroscope.lost_turns import (
    PossibleLosses,
    is_asked_for_losses,
    losses_that_fit,
    relative_sigma,
)
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.gyroscope.observability import describe
from trihedron.estimate.gyroscope.starts import MoveOptions
from trihedron.estimate.session.carried import Carried, HeldOut, carried, held_out, move_quality
from trihedron.estimate.session.fit import FALSE_ALARM, SessionSolution, far_moves, refitted, solve_session
from trihedron.estimate.session.observed import Observed, with_prior
from trihedron.estimate.session.start import Log, Near, begun, is_enough, lower, near_one_another
from trihedron.probability import chdtri
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
    """Calibrate the gyro so that its integrated moves carry each pose's gravity into the next (equations 5.1-5.7).

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
        Folds, nominal scale.

    Returns
    -------
    SensorCalibration, tuple of Finding
        ``ω = S raw + b`` in rad/s, and what was noticed.

    Raises
    ------
    ValueError
        When a sensor or every move is missing, or nothing tells the scale to start from.
    """
    log = Log(recording, segments, accelerometer, gravity_m_s2, is_given=True)
    found = solved(log, options or MoveOptions())
    return in_frame_of(accelerometer, found), found.findings


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


@dataclass(frozen=True, eq=False)
class _Fit:
    """A session fitted to the moves ``used`` (m,), others being lost or far from these; all are ``seen``."""

    measured: MoveMeasurements
    used: BoolArray
    observed: Observed
    solution: SessionSolution
    seen: Carried

    @property
    def outliers(self) -> tuple[int, ...]:
        """Moves that were excluded."""
        return tuple(np.flatnonzero(~self.used & ~self.measured.is_lost).tolist())


def solved(log: Log, options: MoveOptions) -> SolvedSession:
    """The session model from the scale that is nearest to the moves (docs/model-session.md).

    Raises
    ------
    ValueError
        When a sensor or every move is missing, or nothing tells the scale to start from.
    """
    measured, near = begun(log, options.nominal())
    found = _with_hidden_turns(log, _fitted(log, measured, near), near)
    measured, solution, seen = found.measured, found.solution, found.seen
    shown = solution.as_read(measured)
    left_out = held_out(found.observed, shown, log.anchors_s(measured), solution, options.n_folds)
    covariance = solution.covariance.copy()
    if measured.attitude is not None:
        more = solution.S_w @ np.diag(measured.attitude.var_bias) @ solution.S_w.T
        covariance[21:, 21:] += np.diag(np.maximum(np.diag(more) - np.diag(covariance[21:, 21:]), 0.0))
    losses = _losses(log, found)
    own_sigma = relative_sigma(covariance[12:, 12:], solution.S_w)
    covariance[12:, 12:] = losses.widened(covariance[12:, 12:], solution.S_w, solution.b_w, solution.inflation[0] ** 2)
    gyroscope = SensorCalibration(
        S=solution.S_w,
        b=solution.b_w,
        covariance=covariance[12:, 12:],
        raw_unit=log.recording.gyroscope_unit.value,
        si_unit="rad/s",
        method="moves" if log.is_given else "joint",
        quality=move_quality(
            measured, solution, seen, None if left_out is None else left_out.moves, np.where(found.used, 1.0, 0.0)
        ),
        observability=describe(covariance[12:21, 12:21], solution.S_w),
    )
    said = findings_of(found.outliers, measured, solution, gyroscope, seen)
    return SolvedSession(
        found.observed, solution, covariance, gyroscope, left_out, (*said, *losses.findings(own_sigma))
    )  # fmt: skip


def _fitted(log: Log, measured: MoveMeasurements, near: Near) -> _Fit:
    """The fit of the moves that are not far from the others: one that was knocked would be shared out among all as if
    each were so uncertain. What was excluded at first comes back where the fit of the others does not deny it."""
    used = near_one_another(log, measured, near)
    found = _fit(log, measured, used, near)
    if found.outliers:
        used = used | (~measured.is_lost & ~_denied(found))
        found = found if np.array_equal(used, found.used) else _fit(log, measured, used, near)
    while True:
        observed = found.observed
        far = np.isin(measured.links[:, 0], observed.before[far_moves(found.solution, len(observed.before))])
        if not np.any(used & far) or not is_enough(used & ~far):
            return found
        used = used & ~far
        found = _fit(log, measured, used, near)


def _fit(log: Log, measured: MoveMeasurements, used: BoolArray, near: Near) -> _Fit:
    observed = log.observed(measured, used, near)
    solution = solve_session(observed, *near)
    shown = solution.as_read(measured)
    seen = carried(shown, log.anchors_s(measured), solution.S_a, solution.b_a, solution.S_w)
    return _Fit(measured, used, observed, solution, seen)


def _denied(found: _Fit) -> BoolArray:
    """Moves (m,) that miss beyond what they and the fit leave open."""
    residual, noise, slope = found.seen.in_plane()
    of_fit = slope @ found.solution.covariance[12:21, 12:21] @ np.swapaxes(slope, 1, 2)
    covariance = found.solution.inflation[0] ** 2 * noise + of_fit
    distance = np.einsum("mi,mij,mj->m", residual, np.linalg.inv(covariance), residual)
    out: BoolArray = distance > chdtri(2, FALSE_ALARM / len(distance))
    return out


def _with_hidden_turns(log: Log, plain: _Fit, near: Near) -> _Fit:
    """Every move with a turn that its LSB hides, as a support makes that settles, of the rms that is likeliest.

    Where samples may have been lost unseen these are asked for first: they would be as good a reason for the misses.
    """
    measured = plain.measured
    if not np.any(measured.is_undithered) or _is_asked_for_losses(log, plain):
        return plain
    known = np.zeros(measured.rate.shape) if measured.reading_variance is None else measured.reading_variance
    best, likeliest = measured, plain.solution.core.log_marginal
    for hidden_s in HIDDEN_S:
        variance = known.copy()
        variance[measured.edges[:, 1] - 2] += (hidden_s / measured.nominal_step_s * measured.quantum.max()) ** 2
        tried = replace(measured, reading_variance=variance)
        found = solve_session(log.observed(tried, plain.used, near), *near).core.log_marginal
        if found <= likeliest:
            break
        best, likeliest = tried, found
    return plain if best is measured else _fitted(log, best, near)


def in_frame_of(accelerometer: SensorCalibration, found: SolvedSession) -> SensorCalibration:
    """The gyro in the frame of the accelerometer that was given, whose own errors are in its covariance.

    Each of the accelerometer's standard errors turns the frame and moves what the session is held to.
    """
    R = lower(accelerometer.S, accelerometer.b)[2].T
    to_frame = np.zeros((12, 12))
    to_frame[:9, :9], to_frame[9:, 9:] = np.kron(R, np.eye(3)), R
    S, b = R @ found.solution.S_w, R @ found.solution.b_w
    covariance = to_frame @ found.gyroscope.covariance @ to_frame.T
    for direction in _standard_errors(accelerometer.covariance):
        S_a, b_a, into = lower(accelerometer.S + direction[:9].reshape(3, 3), accelerometer.b + direction[9:])
        observed = with_prior(found.observed, S_a, b_a, found.solution.S_w, is_given=True)
        other = refitted(observed, found.solution)
        off = np.concatenate([(into.T @ other.S_w - S).ravel(), into.T @ other.b_w - b])
        covariance += np.outer(off, off)
    return replace(found.gyroscope, S=S, b=b, covariance=covariance)


def _standard_errors(covariance: FloatArray) -> FloatArray:
    """Rows (k, 12) whose squares sum to a covariance (12, 12)."""
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    # Scaled first: counts and m/s² spread the variances over many decades.
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    keep = values > 1e-10 * float(values.max())
    out: FloatArray = (size[:, None] * vectors[:, keep] * np.sqrt(values[keep])).T
    return out


def _is_asked_for_losses(log: Log, found: _Fit) -> bool:
    return is_asked_for_losses(log.recording.time_s, found.measured, found.outliers, found.solution, found.seen)


def _losses(log: Log, found: _Fit) -> PossibleLosses:
    """Samples lost unseen that may be behind what the moves miss."""
    if not _is_asked_for_losses(log, found):
        return PossibleLosses()
    missed, dof = (found.seen.angle_deg, found.seen.floor2), found.solution.moves_dof
    return losses_that_fit(
        log.recording.time_s, found.measured, found.solution.S_w, log.gravity_m_s2, missed, dof, found.used
    )
