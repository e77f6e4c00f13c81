"""Method 1: gyro calibration from turns by known angles about known axes (a table, a wall, a square case)."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, rms_of
from trihedron.errors import InputError
from trihedron.estimate.gyroscope.findings import TurnName, drift_findings, loose_turns, wrong_turn
from trihedron.estimate.gyroscope.stated_turns import contradicted
from trihedron.estimate.gyroscope.turn_angles import (
    QUARTER,
    SCALE_TOLERANCE,
    KnownTurn,
    Turn,
    TurnAngleUnknownError,
    identify_turns,
    measure_turns,
    nominal_matrix,
    spans_three_axes,
)
from trihedron.estimate.gyroscope.turn_system import TurnSystem
from trihedron.estimate.known_vectors import KnownFit
from trihedron.probability import FALSE_ALARM, chdtrc
from trihedron.records import Finding, FindingCode, FitQuality, Observability, Recording, SensorCalibration
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
) -> tuple[SensorCalibration, tuple[Finding, ...]]:
    """Calibrate the gyro from turns about known axes: ``φ'_i = S_w φ_i + b_w Δt_i + δφ_i`` (equation 5.12).

    Angles of ``turns`` (whole turns too) are found from the data where they are not stated; ``static`` are intervals
    without rotation. ``nominal_scale`` (3, 3) or a number [rad/s per raw unit], with its relative tolerance, identifies
    multiples of 90°; it follows from the unit unless readings are counts. Stated angles need none; their scale has
    precedence where they span three axes. White rate noise ``N`` [unit/√Hz] gives ``var δφ = N² Δt``. The result is the
    direct form ``ω = S raw + b`` in the frame of the turns' axes.

    Raises ``InputError`` when usable turns do not span three axes or there is no static interval; or, with the
    question to the user, when readings are counts and neither the angles nor a nominal scale are given.
    """
    measured = measure_turns(recording, turns, static)
    nominal = nominal_matrix(recording, measured, turns, nominal_scale)
    known = identify_turns(measured, turns, nominal, nominal_tolerance)
    used = np.array([turn.is_used for turn in known], dtype=bool)
    _require_every_axis(known, used, rate_to_si(recording.gyroscope_unit) is None)
    system = TurnSystem(
        measured,
        angles=np.array([one.angle_rad * one.turn.direction for one in known]),
        to_rad=nominal,
        faces=np.array([turn.face for turn in turns], dtype=np.int64),
    )
    screened = screen(system, used)
    system, used = screened.system, screened.used
    fit = system.solve(used)
    S, b = other_form(fit.S_a, fit.b_a)
    inflation = _inflation(fit)
    jacobian = other_form_jacobian(fit.S_a, fit.b_a)
    # S is by rad of the system, and raw by its scale.
    jacobian[:9] = np.kron(np.eye(3), system.to_rad.T) @ jacobian[:9]
    covariance = jacobian @ (inflation * fit.covariance + system.correlation(fit, used)) @ jacobian.T
    calibration = SensorCalibration(
        S=S @ system.to_rad,
        b=b,
        covariance=0.5 * (covariance + covariance.T),
        raw_unit=recording.gyroscope_unit.value,
        si_unit="rad/s",
        method="turns",
        quality=_quality(system, used, fit, S),
        observability=_observability(fit),
    )
    deviation = system.residual(fit) @ S.T
    return calibration, tuple(
        turn_findings(known, screened, deviation, calibration.S, inflation, fit.dof, recording.time_s)
    )


def _inflation(fit: KnownFit) -> float:
    """χ² per degree of freedom where it is significant at ``FALSE_ALARM``, else 1."""
    is_beyond_chance = fit.dof > 0 and chdtrc(fit.dof, fit.chi2) < FALSE_ALARM
    return fit.chi2 / fit.dof if is_beyond_chance else 1.0


def _require_every_axis(known: Sequence[KnownTurn], used: BoolArray, recording_is_counts: bool) -> None:
    if spans_three_axes(np.array([one.turn.direction for one in known])[used]):
        return
    if recording_is_counts and any(turn.is_ambiguous for turn in known):
        raise TurnAngleUnknownError
    raise InputError(
        f"the {np.count_nonzero(used)} usable turns, of {len(known)}, are about fewer than three directions that are "
        "not in one plane: turn the sensor on a table by known angles on three of its sides, there and back, or give "
        "the angle of each turn"
    )


def _quality(system: TurnSystem, used: BoolArray, fit: KnownFit, S: FloatArray) -> FitQuality:
    """Deviation of each turn from its known angle, (k, 3) rad, in sample and held out."""
    residual = system.residual(fit) @ S.T
    rows = system.rows()
    noise = S @ (rows.noise + rows.shared @ np.swapaxes(rows.shared, 1, 2))[:-1] @ S.T
    held, covariance, _ = system.left_out(used)
    held = held @ S.T
    held_sigma = np.sqrt(np.einsum("mii->mi", S @ covariance @ S.T))
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
        held_out_rms=rms_of(held[is_held]) if np.any(is_held) else None,
        weights=np.where(used, 1.0, 0.0),
        n_iterations=1,
        stopped_because=words("closed-form"),
    )


def _observability(fit: KnownFit) -> Observability:
    singular = fit.singular_values()
    sigma = np.sqrt(np.diag(fit.covariance)[:9]).reshape(3, 3) / np.linalg.norm(fit.S_a, 2)
    i, j = (int(v) for v in np.unravel_index(int(np.argmax(sigma)), (3, 3)))
    weakest = words("gyro-answer", axis=i + 1, about=j + 1, share=sigma[i, j])
    return Observability(12, 12, float(singular[0] / singular[-1]), singular, weakest)


# Turns that the others contradict, and findings of turns.


@dataclass(frozen=True, eq=False)
class Screened:
    """Result: ``used`` turns (k,), ``suspects`` that the others contradict, those of them that were ``removed``."""

    system: TurnSystem
    used: BoolArray
    suspects: tuple[int, ...]
    removed: tuple[int, ...]
    unchecked_axes: tuple[int, ...]


def screen(system: TurnSystem, used: BoolArray) -> Screened:
    """The system without turns that the others show to be wrong, with the tilts and the scatter of the remaining ones.

    Where they do not show which of some turns are wrong, their difference is part of the scatter.
    """
    axes = np.argmax(np.abs(system.angles), axis=1)
    unchecked = tuple(axis for axis in range(3) if np.count_nonzero(used & (axes == axis)) < 2)
    system, at = system.refined(used).tilted(used), np.flatnonzero(used)
    removed, either = (at[one].tolist() for one in contradicted(system.along(used), np.ones(len(at))))
    used = used & ~np.isin(np.arange(len(used)), removed)
    return Screened(system.tilted(used).scattered(used), used, (*removed, *either), tuple(removed), unchecked)


def turn_findings(
    known: Sequence[KnownTurn],
    screened: Screened,
    deviation: FloatArray,
    S: FloatArray,
    inflation: float,
    dof: int,
    time_s: FloatArray,
) -> Iterator[Finding]:
    """Findings: turns that are no multiple of 90°, contradicting turns, axes with a single turn, handedness, drift."""
    at = [TurnName(one.turn.number or i + 1, float(time_s[one.turn.start])) for i, one in enumerate(known)]
    yield from (_not_a_multiple(at[i], turn) for i, turn in enumerate(known) if _is_wrong(turn))
    for index in screened.suspects:
        one, error = known[index], float(np.linalg.norm(deviation[index]))
        is_excluded, is_stated = index in screened.removed, one.turn.angle_rad is not None
        yield wrong_turn(at[index], one.angle_rad, one.turn.axis, error, is_excluded=is_excluded, is_stated=is_stated)
    yield from loose_turns(screened.system.sigma_turn)
    if screened.unchecked_axes:
        yield Finding.of(FindingCode.TURN_UNCHECKED, axes=[axis + 1 for axis in screened.unchecked_axes])
    if np.linalg.det(S) < 0.0:
        yield Finding.of(FindingCode.LEFT_HANDED, "gyro", determinant=np.linalg.det(S))
    if inflation > 1.0:
        yield Finding.of(FindingCode.RESIDUAL_ABOVE_NOISE, "turns", chi2_per_dof=inflation, dof=dof)
    measured = screened.system.measured
    yield from drift_findings("turns", measured.static_rates, measured.bias_excess, S)


def _is_wrong(turn: KnownTurn) -> bool:
    # A move that is no turn (the case was set on another face) is reported only if it was stated as a turn.
    is_turn = turn.turn.angle_rad is not None or turn.off_axis_rad < math.radians(20.0)
    return not turn.is_used and is_turn and abs(turn.seen_rad) > 0.2


def _not_a_multiple(at: TurnName, turn: KnownTurn) -> Finding:
    stated = turn.turn.angle_rad
    return Finding.of(
        FindingCode.TURN_NOT_A_MULTIPLE,
        "no-multiple" if stated is None else "not-the-stated",
        turn=at.number,
        at_s=at.at_s,
        axis=turn.turn.axis + 1,
        seen_rad=turn.seen_rad,
        wanted_rad=QUARTER if stated is None else stated,
    )
