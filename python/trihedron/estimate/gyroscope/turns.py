"""Method 1: gyro calibration from turns by known angles about the axes of the case (a table, a wall, a square case)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from trihedron.arrays import XYZ, BoolArray, FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.gyroscope.turn_angles import (
    AMBIGUOUS,
    MIN_SPREAD,
    SCALE_TOLERANCE,
    KnownTurn,
    Turn,
    identify_turns,
    measure_turns,
    nominal_matrix,
)
from trihedron.estimate.gyroscope.turn_screening import FALSE_ALARM, screen, turn_findings
from trihedron.estimate.gyroscope.turn_system import Solution, TurnSystem, left_out, solve
from trihedron.probability import chdtrc
from trihedron.records.calibration import FitQuality, Observability, SensorCalibration
from trihedron.records.finding import Finding
from trihedron.records.recording import Recording
from trihedron.records.words import words
from trihedron.sensor_model import other_form, other_form_jacobian
from trihedron.units import rate_to_si


def calibrate_turns(
    recording: Recording,
    turns: Sequence[Turn],
    static: Sequence[tuple[int, int]],
    *,
    nominal_scale: FloatArray | float | None = None,
    nominal_tolerance: float = SCALE_TOLERANCE,
    shared_errors: FloatArray | None = None,
) -> tuple[SensorCalibration, tuple[Finding, ...]]:
    """Calibrate the gyro from turns about case axes: ``φ'_i = S_w φ_i + b_w Δt_i + δφ_i`` (equation 5.12).

    Axis and angle of ``turns`` (whole turns too) are found from the data where they are not given; ``static`` are
    intervals without rotation. ``nominal_scale`` (3, 3) or a number [rad/s per raw unit], with its relative tolerance,
    identifies multiples of 90°; it follows from the unit unless readings are counts. Stated turns (angle and axis) need
    none; their scale has precedence where they span three axes. ``shared_errors`` (k, 3, m) is the change of the turns
    [rad] by one standard error of each of m independent errors that all turns share. White rate noise ``N`` [unit/√Hz]
    gives ``var δφ = N² Δt``. The result is the direct form ``ω = S raw + b`` in the case frame.

    Raises ``RefusedError`` when an axis has no usable turn or there is no static interval; or, with the question to the
    user, when readings are counts and neither the angles nor a nominal scale are given.
    """
    measured = measure_turns(recording, turns, static)
    nominal = nominal_matrix(recording, measured, turns, nominal_scale)
    known = identify_turns(measured, turns, nominal, nominal_tolerance)
    used = np.array([turn.is_used for turn in known], dtype=bool)
    _require_every_axis(known, used, rate_to_si(recording.gyroscope_unit) is None)
    roughly = np.asarray(np.linalg.inv(nominal), dtype=np.float64)
    sigmas = np.array([turn.sigma_direction_rad for turn in turns])
    faces = np.array([turn.face for turn in turns], dtype=np.int64)
    vectors = np.array([turn.vector for turn in known])
    system = TurnSystem(measured, vectors, roughly, sigma_directions=sigmas, faces=faces)
    screened = screen(system, used)
    system, used = screened.system, screened.used
    fit = solve(system, used)
    S, b = other_form(fit.S_w, fit.b_w)
    inflation = _inflation(fit)
    added = system.correlation(fit, used)
    if shared_errors is not None:
        pull = system.pull(fit, used, shared_errors)
        added = added + pull @ pull.T
    calibration = SensorCalibration(
        S=S,
        b=b,
        covariance=_covariance(fit, inflation, added),
        raw_unit=recording.gyroscope_unit.value,
        si_unit="rad/s",
        method="turns",
        quality=_quality(system, used, fit, S),
        observability=_observability(system, used, fit),
    )
    deviation = (measured.raw_angle - np.outer(measured.duration_s, fit.b_w)) @ S.T - system.angles
    return calibration, tuple(turn_findings(known, screened, deviation, S, inflation, fit.dof))


def _covariance(fit: Solution, inflation: float, added: FloatArray) -> FloatArray:
    """Covariance (12, 12) of the direct form; ``added`` (12, 12) is that of errors shared by turns, in inverse form."""
    jacobian = other_form_jacobian(fit.S_w, fit.b_w)
    covariance: FloatArray = jacobian @ (inflation * fit.covariance + added) @ jacobian.T
    return 0.5 * (covariance + covariance.T)


def _inflation(fit: Solution) -> float:
    """χ² per degree of freedom where it is significant at ``FALSE_ALARM``, else 1."""
    is_beyond_chance = fit.dof > 0 and chdtrc(fit.dof, fit.chi2) < FALSE_ALARM
    return fit.chi2 / fit.dof if is_beyond_chance else 1.0


def _require_every_axis(known: Sequence[KnownTurn], used: BoolArray, recording_is_counts: bool) -> None:
    if any(turn.direction is not None for turn in known):
        vectors = np.array([turn.vector for turn in known])[used]
        directions = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
        if len(vectors) < 3 or np.linalg.svd(directions, compute_uv=False)[-1] < MIN_SPREAD:
            raise RefusedError(
                f"the {len(vectors)} usable turns are about fewer than three directions that are not parallel: turn "
                "the sensor on a table by known angles on three of its sides"
            )
        return
    missing = [axis for axis in range(3) if not any(t.axis == axis and u for t, u in zip(known, used, strict=True))]
    if missing and recording_is_counts and any(turn.is_ambiguous for turn in known):
        raise RefusedError(AMBIGUOUS)
    if missing:
        names = " and ".join(XYZ[axis] for axis in missing)
        raise RefusedError(
            f"no usable turn about {names} was found among {len(known)}: turn the sensor about it by a known "
            "angle, there and back, or give the angle of each turn"
        )


def _quality(system: TurnSystem, used: BoolArray, fit: Solution, S: FloatArray) -> FitQuality:
    """Deviation of each turn from its known angle, (k, 3) rad, in sample and held out."""
    residual = system.residuals(fit) @ S.T
    noise = S @ system.covariances() @ S.T
    left = left_out(system, used)
    held = left.residual @ S.T
    held_sigma = np.sqrt(np.einsum("mii->mi", S @ left.covariance @ S.T))
    n = 3 * int(np.count_nonzero(used))
    total = float(np.sum(residual[used] ** 2))
    dof = n - 9
    is_held = np.all(np.isfinite(held), axis=1)
    return FitQuality(
        unit="rad",
        residual=residual,
        sigma=np.sqrt(np.einsum("mii->mi", noise)),
        chi2=fit.chi2,
        dof=fit.dof,
        rms=math.sqrt(total / n),
        rms_dof=math.sqrt(total / dof) if dof > 0 else float("nan"),
        floor=float(np.sqrt(np.einsum("mii->m", noise)[used].sum() / n)),
        held_out=held if np.any(is_held) else None,
        held_out_sigma=held_sigma if np.any(is_held) else None,
        held_out_rms=float(np.sqrt(np.mean(held[is_held] ** 2))) if np.any(is_held) else None,
        weights=np.where(used, 1.0, 0.0),
        n_iterations=1,
        stopped_because=words("closed-form"),
    )


def _observability(system: TurnSystem, used: BoolArray, fit: Solution) -> Observability:
    matrix, _ = system.whitened(used)
    singular = np.linalg.svd(matrix / np.linalg.norm(matrix, axis=0), compute_uv=False)
    sigma = np.sqrt(np.diag(fit.covariance)[:9]).reshape(3, 3) / np.linalg.norm(fit.S_w, 2)
    i, j = (int(v) for v in np.unravel_index(int(np.argmax(sigma)), (3, 3)))
    weakest = words("gyro-answer", axis=i + 1, about=j + 1, share=sigma[i, j])
    return Observability(12, 12, float(singular[0] / singular[-1]), singular, weakest)
