"""Fit of a log, or several, to reference motion: composition of the steps (docs/reference.md)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.spatial.transform import Rotation

from trihedron.arrays import AXES, BoolArray, FloatArray, rms_of
from trihedron.estimate.reference.accelerometer import ForceFit, fit_accelerometer, force_along
from trihedron.estimate.reference.beside import Beside, Point
from trihedron.estimate.reference.clocks import Alignment, align
from trihedron.estimate.reference.coloured import without_outliers
from trihedron.estimate.reference.mismatch import (
    reject_still,
    reject_strangers,
    reject_two_clocks,
    reject_units,
)
from trihedron.estimate.reference.motion import ALWAYS, EFFECTS, MotionFit, Scored, fit_motion, scores
from trihedron.estimate.reference.residuals import fine_s, rate_left, validated
from trihedron.estimate.reference.slip import slip_of
from trihedron.estimate.reference.smoothed import (
    bias_over_time,
    error_carried,
    error_over_time,
    without_slow_error,
)
from trihedron.estimate.reference.start import Start, start_of
from trihedron.estimate.reference.together import Grid, Reference, Windows, grid_of, plateaus, windows_beside
from trihedron.estimate.reference.worth import earth_of, error_of, remarks
from trihedron.records import Recording
from trihedron.records.reference import AgainstReference, Estimate, FitToReference, ReferenceMotion
from trihedron.sensor_model import reframing

WINDOW_S = 0.1
"""Least spacing of windows for forces, up to 5 Hz: above it a twice differentiated position is noise."""
TURNED_ROUND = 0.2
"""Residual share of the motion above which the inverse attitude is tried: shared motion leaves some 0.01."""
UNITS = {"gyro-g-sensitivity": "(rad/s)/(m/s^2)", "gyro-scale-nonlinearity": "1/(rad/s), 1/(rad/s)^2"}
LABELS = {
    "gyro-g-sensitivity": tuple(f"G_{a}{b}" for a in AXES for b in AXES),
    "gyro-scale-nonlinearity": tuple(f"{bend}_{a}" for bend in ("quadratic", "cubic") for a in AXES),
}


@dataclass(frozen=True, eq=False)
class Prepared:
    """A log aligned with its reference, and initial values of the model."""

    recording: Recording
    gravity_m_s2: float
    side: Beside
    gyro: Start
    force: ForceFit | None
    windows: Windows
    alignment: Alignment
    seen: BoolArray
    is_turned: bool


def fit_reference(
    recording: Recording,
    motion: ReferenceMotion,
    gravity_m_s2: float,
    *,
    given: tuple[FloatArray, FloatArray] | None = None,
) -> AgainstReference:
    """Fit a log to reference motion.

    ``given`` is a gyro's (S, b) whose replay is compared; it has its own frame, and its rotation to the reference's
    body is taken from the fit. Raises ``InputError`` when the two share no motion, the clock jumps or has two
    possible offsets, units differ by a factor, frames are mirrored, or the motion does not determine the 12 parameters.
    """
    return fit_references([(recording, motion)], gravity_m_s2, given=given)[0]


def fit_references(
    pairs: Sequence[tuple[Recording, ReferenceMotion]],
    gravity_m_s2: float,
    *,
    given: tuple[FloatArray, FloatArray] | None = None,
) -> tuple[AgainstReference, ...]:
    """Fit recordings of one unit, each with its reference: S and effects are common, biases and clocks per recording.

    Mountings are per recording where the evidence prefers it. One result per recording; common parameters are equal.
    Raises as :func:`fit_reference`, for the first pair concerned.
    """
    ready = [_prepared(recording, motion, gravity_m_s2) for recording, motion in pairs]
    found, effects = _fitted([one.side for one in ready])
    for k, one in enumerate(ready):
        reject_two_clocks(found, k)
        reject_still(one.side.reference.motion, found.value(k, "S"), found.covariance(k, ("S",)))
    return tuple(_answer(one, found, k, effects, given) for k, one in enumerate(ready))


def _fitted(sides: list[Beside]) -> tuple[MotionFit, list[Scored]]:
    """The fit with all accepted effects, and a mounting per recording if the evidence prefers it; scored effects."""
    found = fit_motion(sides)
    wanted: tuple[str, ...] = ALWAYS
    if len(sides) > 1:
        mounted = fit_motion(sides, (*ALWAYS, "mounting"), before=found)
        if mounted.fitted.evidence > found.fitted.evidence:
            found, wanted = mounted, (*ALWAYS, "mounting")
    effects = scores(found)
    accepted = {one.ident: one.wider for one in effects if one.is_accepted}
    if accepted:
        names = tuple(name for ident in accepted for name in EFFECTS[ident])
        wider = {name: by for ident, by in accepted.items() for name in EFFECTS[ident]}
        found = fit_motion(sides, tuple(dict.fromkeys((*wanted, *names))), wider)
    return found, effects


def _begun(recording: Recording, motion: ReferenceMotion) -> tuple[Grid, Reference, Alignment, BoolArray, Start]:
    """The log on its grid, its reference, the clocks' alignment, where both are seen, and a first gyro."""
    grid, reference = grid_of(recording), Reference(motion)
    found = align(grid, reference, _stamped(recording, motion))
    time = grid.time_s * (1.0 + found.rate) + found.offset_s
    seen = grid.is_valid & reference.covers(time)
    if motion.is_stepwise:
        seen &= plateaus(grid, reference, time)
    return grid, reference, found, seen, start_of(grid, reference, seen, found)


def _prepared(recording: Recording, motion: ReferenceMotion, gravity_m_s2: float) -> Prepared:
    grid, reference, found, seen, gyro = _begun(recording, motion)
    reference, gyro, is_turned = _right_way_round(grid, reference, seen, gyro)
    motion = reference.motion
    reject_strangers(gyro, motion)
    reject_units(recording, gyro, motion)
    reject_still(motion, gyro.S, gyro.covariance)
    windows = windows_beside(grid, reference, seen, WINDOW_S)
    force = fit_accelerometer(grid, reference, windows, gyro.clock, gravity_m_s2, gyro.handedness)
    felt = None if force is None else force_along(grid, force, gyro.S, gravity_m_s2)
    has_truth = grid.is_valid if motion.attitude is not None else seen
    side = Beside(grid, reference, has_truth, Point(gyro.S, gyro.b, gyro.clock.offset_s, gyro.clock.rate), felt)
    return Prepared(recording, gravity_m_s2, side, gyro, force, windows, found, seen, is_turned)


def _answer(
    one: Prepared, found: MotionFit, k: int, effects: list[Scored], given: tuple[FloatArray, FloatArray] | None
) -> AgainstReference:
    side, point, motion, force = one.side, found.points[k], one.side.reference.motion, one.force
    S, b = found.value(k, "S").reshape(3, 3), found.value(k, "b")
    covariance = found.covariance(k, ("S", "b"))
    has_clock, cross = "clock" in found.places[k], np.zeros((12, 12))
    clock = found.value(k, "clock") if has_clock else np.array([point.offset_s, 0.0])
    sigma = np.sqrt(np.diag(found.covariance(k, ("clock",)))) if has_clock else np.array([np.nan, np.nan])
    if force is not None:
        known, rate = without_slow_error(found, k), float(clock[1])
        steady = replace(one.alignment, offset_s=float(clock[0]) - rate * side.middle_s * has_clock, rate=rate)
        force = fit_accelerometer(side.grid, known, one.windows, steady, one.gravity_m_s2, one.gyro.handedness)
    if force is not None:
        carried, cross = error_carried(found, k, force, side.grid.time_s[one.windows.middle])
        force = replace(force, covariance=force.covariance + carried)
    replay, rms_held_out = validated(found, k, given)
    _, left = rate_left(side, point)
    used = without_outliers(np.linalg.norm(left, axis=1))
    gyroscope = FitToReference(
        S, b, covariance, rms_of(left[used]), rms_held_out, 0.5 / fine_s(side), len(left), int(np.sum(~used)), 1.0
    )
    result = AgainstReference(
        kind=motion.kind,
        source=motion.source,
        clock_offset_s=(_own_counts(clock[0], one.recording, motion), float(sigma[0])),
        clock_middle_s=side.middle_s,
        clock_rate_ppm=(1e6 * float(clock[1]), 1e6 * float(sigma[1])) if has_clock else None,
        overlap_s=float(one.seen.sum()) * side.grid.step_s,
        correlation=one.alignment.correlation,
        gyroscope=gyroscope,
        accelerometer=None if force is None else _accelerometer(force, one.windows),
        mounting=_mounting(S, b, covariance),
        lever_arm=None if force is None else force.arm,
        vertical=None if force is None else force.up,
        earth_rate=_earth(found, effects, k),
        effects=MappingProxyType(_estimates(found, k, effects)),
        replay=replay,
        cross_covariance=cross[:12],
        error=error_of(found, k),
        bias=bias_over_time(found, k),
        apart=error_over_time(found, k),
    )
    slip = slip_of(found, k, result.error)
    return replace(result, findings=(*motion.findings, *remarks(result, one.is_turned, slip)))


def laid_beside(recording: Recording, motion: ReferenceMotion, gravity_m_s2: float) -> Beside:
    """A log on its grid with its aligned reference and initial values for a fit; raises as :func:`fit_reference`."""
    return _prepared(recording, motion, gravity_m_s2).side


def moves_along(recording: Recording, motion: ReferenceMotion) -> float:
    """Correlation of the magnitudes of the rates of a log and a reference with one motion.

    Raises ``InputError`` when they share no motion, or the clock jumps.
    """
    _, _, found, _, gyro = _begun(recording, motion)
    reject_strangers(gyro, motion)
    # With little rotation two logs resemble each other by chance.
    reject_still(motion, gyro.S, gyro.covariance)
    return found.correlation


def _right_way_round(grid: Grid, reference: Reference, seen: BoolArray, gyro: Start) -> tuple[Reference, Start, bool]:
    """The reference as given, or with inverted attitudes (given as world to body) where only these fit the log."""
    attitude = reference.motion.attitude
    if attitude is None or gyro.share_left < TURNED_ROUND:
        return reference, gyro, False
    other = Reference(replace(reference.motion, attitude=np.ascontiguousarray(np.swapaxes(attitude, 1, 2))))
    turned = start_of(grid, other, seen, gyro.clock)
    return (other, turned, True) if turned.share_left < 0.5 * gyro.share_left else (reference, gyro, False)


def _stamped(recording: Recording, motion: ReferenceMotion) -> float | None:
    """Offset of the clocks by both logs' timestamps [s]; ``None`` where these have no common epoch."""
    offset = recording.start_epoch_s - motion.start_epoch_s
    return offset if abs(offset) < 0.5 * max(recording.duration_s, motion.time_s[-1]) else None


def _own_counts(offset: float, recording: Recording, motion: ReferenceMotion) -> float:
    """Offset of the reference's timestamps from the log's [s], in their original counts if they share an epoch."""
    if abs(recording.start_epoch_s - motion.start_epoch_s) > 1e5:
        return float(offset)
    return float(offset + motion.start_epoch_s - recording.start_epoch_s)


def _earth(found: MotionFit, effects: list[Scored], k: int) -> Estimate | None:
    """The Earth's rate; its vertical part is confounded with g-sensitivity, which is excluded if not accepted."""
    for one in effects:
        if one.ident == "gyro-g-sensitivity" and not one.is_accepted:
            return earth_of(one.without, k)
    return earth_of(found, k)


def _accelerometer(force: ForceFit, windows: Windows) -> FitToReference:
    solution = force.solution
    return FitToReference(
        S=force.S,
        b=force.b,
        covariance=force.covariance[:12, :12],
        rms=rms_of(solution.residual[solution.is_used]),
        rms_held_out=solution.rms_held_out,
        band_hz=0.5 / (windows.spacing * windows.step_s),
        n_rows=len(solution.residual),
        n_left_out=int(np.count_nonzero(~solution.is_used)),
        widened=solution.widened,
    )


def _mounting(S: FloatArray, b: FloatArray, covariance: FloatArray) -> Estimate:
    """Rotation vector [rad] from the gyro triad's symmetric frame to the reference's body frame."""
    change = reframing(S, b, "symmetric")
    turn = Rotation.from_matrix(change.rotation.T).as_rotvec()
    return Estimate(AXES, turn, change.tilt @ covariance @ change.tilt.T, "rad")


def _estimates(found: MotionFit, k: int, effects: list[Scored]) -> dict[str, Estimate]:
    """Every scored effect with its score, and its value from a fit that includes it."""
    out = {}
    for one in effects:
        names = EFFECTS[one.ident]
        if not all(found.sides[k].has(name) for name in names):
            continue
        fit = found if all(name in found.places[k] for name in names) else one.fitted
        value = np.concatenate([fit.value(k, name) for name in names])
        shown = one.shown_from()
        out[one.ident] = Estimate(
            LABELS[one.ident], value, fit.covariance(k, names), UNITS[one.ident], one.score, shown
        )
    return out
