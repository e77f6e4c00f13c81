"""Solution of a recording's session: initial scale, outlier moves, fit of both sensors, and their uncertainties."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from trihedron.arrays import TINY, BoolArray, FloatArray
from trihedron.channel_facts.static_axes import find_low_passes
from trihedron.estimate.accelerometer.verdict import residual_findings
from trihedron.estimate.gyroscope.findings import describe, findings_of
from trihedron.estimate.gyroscope.lost_samples import (
    PossibleLosses,
    could_be_remade,
    possible_losses,
    relative_sigma,
)
from trihedron.estimate.gyroscope.measurements import MoveMeasurements, measure_moves
from trihedron.estimate.session.carried import N_GYROSCOPE, Carried, HeldOut, held_out, move_quality, norm_quality
from trihedron.estimate.session.fit import SessionSolution, far_moves, solve_session
from trihedron.estimate.session.observed import Near
from trihedron.estimate.session.start import Log, begun
from trihedron.probability import FALSE_ALARM, fdtrc
from trihedron.records import Calibration, Finding, Recording, Segments, SensorCalibration
from trihedron.session.noise import NOISE_DOF


def calibrate_moves(
    recording: Recording,
    segments: Segments,
    accelerometer: SensorCalibration,
    gravity_m_s2: float,
    nominal: float | None = None,
) -> tuple[SensorCalibration, tuple[Finding, ...]]:
    """Calibrate the gyro from the tilt errors after rotations between poses (equations 5.1-5.7).

    ``nominal`` [rad/s per raw unit] is needed where the moves do not determine an initial one.

    The ``accelerometer`` is lower-triangular, its covariance enters the gyro's. Raises
    ``InputError`` when a sensor or every move is missing, or no initial scale can be determined.
    """
    log = Log(recording, segments, accelerometer, gravity_m_s2, is_given=True, nominal=nominal)
    found = solved(log)
    return beside_given(accelerometer, found), found.findings


@dataclass(frozen=True, eq=False)
class SolvedSession:
    """A session at its optimum, in the lower-triangular frame.

    ``covariance`` (24, 24) of the parameters includes lost samples; ``gyroscope`` is
    the gyro's record, ``held_out`` the cross-validated residuals; ``findings`` are those of the moves.
    """

    solution: SessionSolution
    covariance: FloatArray
    gyroscope: SensorCalibration
    held_out: HeldOut | None
    findings: tuple[Finding, ...]


@dataclass(frozen=True, eq=False)
class _Fit:
    """A session fitted to the moves ``used`` (m,), without clipped moves and outliers."""

    log: Log
    measured: MoveMeasurements
    used: BoolArray
    solution: SessionSolution

    @cached_property
    def shown(self) -> MoveMeasurements:
        """The moves as corrected by the solution."""
        return self.solution.as_read(self.measured)

    @cached_property
    def seen(self) -> Carried:
        """Tilt errors after all moves."""
        return self.log.carried(self.shown, (self.solution.S_a, self.solution.b_a, self.solution.S_w))

    @property
    def outliers(self) -> tuple[int, ...]:
        """Moves that were excluded as outliers."""
        return tuple(np.flatnonzero(~self.used & ~self.measured.is_lost).tolist())


def solved(log: Log) -> SolvedSession:
    """Fit the session model (docs/model-session.md).

    Raises ``InputError`` when a sensor or every move is missing, or no initial scale can be determined.
    """
    measured = measure_moves(log.recording, log.segments, log.accelerometer)
    near = begun(log, measured)
    whole, found = _fitted(log, measured, near)
    # Nonlinearities and delays would be taken for filters: that there is one the noise at rest must show.
    if found.solution.smooths_more_than_means and _has_low_pass(log.recording):
        log = replace(log, is_filtered=True)
        whole, found = _fitted(log, measured, near)
    solution, seen = found.solution, found.seen
    left_out = held_out(found.shown, log.anchors_s(measured), solution)
    covariance = solution.covariance.copy()
    losses = _losses(log, whole, found)
    own_sigma = relative_sigma(covariance[12:, 12:], solution.S_w)
    covariance[12:, 12:] = losses.widened(covariance[12:, 12:], solution.S_w, solution.b_w)
    quality = move_quality(
        log.gravity_m_s2,
        seen,
        None if left_out is None else left_out.moves,
        np.where(found.used, 1.0, 0.0),
        (solution.moves_chi2, round(solution.moves_dof)),
    )
    gyroscope = SensorCalibration(
        S=solution.S_w,
        b=solution.b_w,
        covariance=covariance[12:, 12:],
        raw_unit=log.recording.gyroscope_unit.value,
        si_unit="rad/s",
        method="moves" if log.is_given else "joint",
        quality=replace(quality, n_iterations=solution.iterations, stopped_because=solution.stopped_because),
        observability=describe(covariance[12:21, 12:21], solution.S_w),
    )
    said = findings_of(found.outliers, found.shown, solution, gyroscope, seen, log.recording)
    return SolvedSession(
        solution, covariance, gyroscope, left_out, (*said, *losses.findings(own_sigma))
    )  # fmt: skip


def _has_low_pass(recording: Recording) -> bool:
    """Whether the gyro's noise at rest shows a low-pass, on all axes, as one filter has."""
    assert recording.gyroscope is not None
    found = find_low_passes({"gyroscope": recording.gyroscope}, recording.rate_hz)
    return bool(found) and all(one.corner_hz is not None for one in found["gyroscope"])


def _fitted(log: Log, measured: MoveMeasurements, near: Near) -> tuple[_Fit, _Fit]:
    """The fit of all moves that did not clip, and that without outliers: disturbed moves widen the variance of all."""
    used = ~measured.is_lost
    whole = found = _fit(log, measured, used, near)
    while True:
        observed = found.solution.observed
        far = np.isin(measured.links[:, 0], observed.before[far_moves(found.solution, len(observed.before))])
        # Outliers are told where the other moves overdetermine the gyro's scale.
        if not np.any(used & far) or 2 * np.count_nonzero(used & ~far) <= N_GYROSCOPE + 2:
            return whole, found
        used = used & ~far
        found = _fit(log, measured, used, near)


def _fit(log: Log, measured: MoveMeasurements, used: BoolArray, near: Near) -> _Fit:
    return _Fit(log, measured, used, solve_session(log.observed(measured, used, near), *near))


def beside_given(accelerometer: SensorCalibration, found: SolvedSession) -> SensorCalibration:
    """The gyro with the error of the given ``accelerometer`` in its covariance.

    ``∂(S_ω, b_ω)/∂(S, b) = C_ωa C_a⁻¹`` of the fit, whose prior of the accelerometer is narrower than what the moves
    show of it.
    """
    covariance = found.solution.covariance
    known = np.flatnonzero(np.diag(covariance)[:12])
    size = np.sqrt(np.diag(covariance)[known])
    inverse = np.linalg.inv(covariance[np.ix_(known, known)] / np.outer(size, size)) / np.outer(size, size)
    slope = covariance[12:, known] @ inverse
    by_given = slope @ accelerometer.covariance[np.ix_(known, known)] @ slope.T
    return replace(found.gyroscope, covariance=found.gyroscope.covariance + by_given)


def _losses(log: Log, whole: _Fit, found: _Fit) -> PossibleLosses:
    """Undetected lost samples that may explain the tilt errors: a move that lost samples is an outlier among those that
    lost none, so that the fit of the ``whole`` session is asked."""
    sampling, fitted = log.recording.sampling, found.solution
    shows_losses = sampling.is_even and sampling.has_own_clock
    if shows_losses or not could_be_remade(log.recording.time_s, found.measured.nominal_step_s):
        return PossibleLosses()
    losses = possible_losses(log.recording, log.segments, whole.solution.core)
    if fitted.moves_dof < 1.0 or fdtrc(fitted.moves_dof, NOISE_DOF, fitted.moves_chi2 / fitted.moves_dof) > FALSE_ALARM:
        return losses
    return replace(losses, scatter=_mean_square(log, found) / fitted.inflation[0] ** 2)


def _mean_square(log: Log, found: _Fit) -> float:
    """Mean square of the tilt errors over that by noise: beyond the square of the usual one where few are large."""
    seen, used = found.seen, found.used
    errors = np.radians(seen.angle_deg[used]) * log.gravity_m_s2
    by_noise = float(seen.floor2[used].sum()) * max(found.solution.moves_dof, 1.0) / (2.0 * np.count_nonzero(used))
    return float((errors**2).sum()) / max(by_noise, TINY)


# Joint fit of both sensors: the reference solution, with the covariance of all 24 parameters.


def calibrate_joint(
    recording: Recording,
    segments: Segments,
    alone: Calibration,
    nominal: float | None = None,
    known_scale: FloatArray | None = None,
) -> Calibration:
    """Fit ``S_f, b_f, S_ω`` to the norm of every pose and the rotation of every move at once (equation 5.7).

    The noise of a pose's mean enters its norm and both neighbouring moves, with its full covariance. The frame is
    lower-triangular: the data do not determine the rotation of the triad against the case. The fit starts from
    ``alone``, the accelerometer calibrated by poses, whose residuals it replaces, and from the gyro's ``known_scale``
    (3, 3) where turns show it; ``nominal`` and errors are those of ``calibrate_moves``.
    """
    log = Log(
        recording, segments, alone.accelerometer, alone.gravity_m_s2, is_given=False, nominal=nominal, scale=known_scale
    )
    found = solved(log)
    solution, left_out = found.solution, found.held_out
    quality = norm_quality(solution, None if left_out is None else (left_out.norm, left_out.norm_sigma))
    has_temperature = recording.temperature_degc is not None
    of_residual = residual_findings(quality.chi2, quality, *solution.accel_bias_change, has_temperature=has_temperature)
    still = [finding for finding in alone.findings if finding.code != "residual-above-noise"]
    return replace(
        alone,
        accelerometer=replace(
            alone.accelerometer,
            S=solution.S_a,
            b=solution.b_a,
            covariance=found.covariance[:12, :12],
            method="joint",
            quality=quality,
        ),
        gyroscope=found.gyroscope,
        covariance=found.covariance,
        findings=(*still, *of_residual, *found.findings),
        averaging=solution.averaging,
    )
