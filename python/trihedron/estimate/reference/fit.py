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
from trihedron.estimate.reference.coloured import Solution
from trihedron.estimate.reference.gyroscope import GyroFit, fit_gyroscope, held_out
from trihedron.estimate.reference.mismatch import (
    reject_still,
    reject_strangers,
    reject_two_clocks,
    reject_units,
    share_left,
)
from trihedron.estimate.reference.motion import ALWAYS, EFFECTS, MotionFit, Scored, fit_motion, scores
from trihedron.estimate.reference.slip import slip_of
from trihedron.estimate.reference.smoothed import (
    bias_over_time,
    error_carried,
    error_over_time,
    frame_covariance,
    without_slow_error,
)
from trihedron.estimate.reference.together import Grid, Reference, Windows, grid_of, plateaus, windows_on
from trihedron.estimate.reference.worth import earth_of, error_of, remarks
from trihedron.records import Recording
from trihedron.records.reference import AgainstReference, Estimate, FitToReference, ReferenceMotion
from trihedron.sensor_model import reframing

MOST_WINDOWS = 20_000
"""Most windows; a longer log has longer windows: 0.18 s for an hour, still short for motion by hand."""
FINEST = 4
"""Fewest samples between windows: a cubic B-spline over 16 samples has a summation error of 1e-6."""
FORCE_WINDOW_S = 0.1
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
    """A log aligned with its reference: initial values of the model, and the fits by windows."""

    recording: Recording
    gravity_m_s2: float
    side: Beside
    gyro: GyroFit
    force: ForceFit | None
    windows: Windows
    wide: Windows
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


def _prepared(recording: Recording, motion: ReferenceMotion, gravity_m_s2: float) -> Prepared:
    grid, reference = grid_of(recording), Reference(motion)
    found = align(grid, reference, _stamped(recording, motion))
    time = grid.time_s * (1.0 + found.rate) + found.offset_s
    seen = grid.is_valid & reference.covers(time)
    if motion.is_stepwise:
        seen &= plateaus(grid, reference, time)
    windows = _windows(grid, reference, seen)
    clock = 0 if motion.is_stepwise else 2
    gyro = fit_gyroscope(grid, reference, windows, found.offset_s, found.rate, clock=clock)
    reference, gyro, is_turned = _right_way_round(grid, reference, windows, gyro, clock)
    motion = reference.motion
    reject_strangers(gyro, motion)
    reject_units(recording, gyro, motion)
    reject_still(motion, gyro.A.ravel(), gyro.solution.covariance[:9, :9])
    wide = windows_on(seen, grid.step_s, max(windows.spacing, round(FORCE_WINDOW_S / grid.step_s)))
    force = fit_accelerometer(grid, reference, wide, gyro.offset_s, gyro.rate, gravity_m_s2, gyro.handedness)
    felt = None if force is None else force_along(grid, force, gyro.A, gravity_m_s2)
    has_truth = grid.is_valid if motion.attitude is not None else seen
    side = Beside(grid, reference, has_truth, Point(gyro.A, gyro.a, gyro.offset_s, gyro.rate), felt)
    return Prepared(recording, gravity_m_s2, side, gyro, force, windows, wide, found, seen, is_turned)


def _answer(
    one: Prepared, found: MotionFit, k: int, effects: list[Scored], given: tuple[FloatArray, FloatArray] | None
) -> AgainstReference:
    side, motion, force = one.side, one.side.reference.motion, one.force
    S, b = found.value(k, "S").reshape(3, 3), found.value(k, "b")
    covariance = found.covariance(k, ("S", "b"))
    has_clock = "clock" in found.places[k]
    clock = found.value(k, "clock") if has_clock else np.array([one.gyro.offset_s, 0.0])
    sigma = np.sqrt(np.diag(found.covariance(k, ("clock",)))) if has_clock else np.array([np.nan, np.nan])
    frame = frame_covariance(found, k)
    if force is not None:
        known, rate = without_slow_error(found, k), float(clock[1])
        offset = float(clock[0]) - rate * (side.middle_s if has_clock else 0.0)
        force = fit_accelerometer(side.grid, known, one.wide, offset, rate, one.gravity_m_s2, one.gyro.handedness)
    if force is not None:
        force = force.with_error(error_carried(found, k, force, side.grid.time_s[one.wide.middle], frame))
    up = None if force is None or force.up_covariance is None else _estimate(force.up, force.up_covariance, "1")
    result = AgainstReference(
        kind=motion.kind,
        source=motion.source,
        clock_offset_s=(_own_counts(clock[0], one.recording, motion), float(sigma[0])),
        clock_middle_s=side.middle_s,
        clock_rate_ppm=(1e6 * float(clock[1]), 1e6 * float(sigma[1])) if has_clock else None,
        overlap_s=float(one.seen.sum()) * side.grid.step_s,
        correlation=one.alignment.correlation,
        gyroscope=_fit(S, b, covariance, one.gyro.solution, one.windows),
        accelerometer=None if force is None else _fit(force.S, force.b, force.covariance, force.solution, one.wide),
        mounting=_mounting(S, b, covariance),
        lever_arm=None
        if force is None or force.arm_covariance is None
        else _estimate(force.arm, force.arm_covariance, "m"),
        vertical=up,
        earth_rate=_earth(found, effects, k),
        effects=MappingProxyType(_estimates(found, k, effects)),
        replay=() if motion.attitude is None else held_out(one.side, one.seen, one.gyro, given, _windows),
        frame_covariance=frame,
        error=error_of(found, k),
        bias=bias_over_time(found, k),
        residual_time_s=side.grid.time_s[one.windows.middle],
        residual_rate=one.gyro.solution.residual,
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
    grid, reference = grid_of(recording), Reference(motion)
    found = align(grid, reference, _stamped(recording, motion))
    time = grid.time_s * (1.0 + found.rate) + found.offset_s
    windows = _windows(grid, reference, grid.is_valid & reference.covers(time))
    gyro = fit_gyroscope(grid, reference, windows, found.offset_s, found.rate, clock=1)
    reject_strangers(gyro, motion)
    # With little rotation two logs resemble each other by chance.
    reject_still(motion, gyro.A.ravel(), gyro.solution.covariance[:9, :9])
    return found.correlation


def _right_way_round(
    grid: Grid, reference: Reference, windows: Windows, gyro: GyroFit, clock: int
) -> tuple[Reference, GyroFit, bool]:
    """The reference as given, or with inverted attitudes (given as world to body) where only these fit the log."""
    attitude = reference.motion.attitude
    if attitude is None or share_left(gyro) < TURNED_ROUND:
        return reference, gyro, False
    other = Reference(replace(reference.motion, attitude=np.ascontiguousarray(np.swapaxes(attitude, 1, 2))))
    turned = fit_gyroscope(grid, other, windows, gyro.offset_s, gyro.rate, clock=clock)
    if share_left(turned) < 0.5 * share_left(gyro):
        return other, turned, True
    return reference, gyro, False


def _stamped(recording: Recording, motion: ReferenceMotion) -> float | None:
    """Offset of the clocks by both logs' timestamps [s]; ``None`` where these have no common epoch."""
    offset = recording.start_epoch_s - motion.start_epoch_s
    return offset if abs(offset) < 0.5 * max(recording.duration_s, motion.time_s[-1]) else None


def _windows(grid: Grid, reference: Reference, seen: BoolArray) -> Windows:
    spacing = max(FINEST, int(np.ceil(len(grid.time_s) / MOST_WINDOWS)))
    if not reference.motion.is_stepwise:
        spacing = max(spacing, int(np.ceil(2.0 * reference.step_s / grid.step_s)))
    return windows_on(seen, grid.step_s, spacing)


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


def _estimate(value: FloatArray | None, covariance: FloatArray, unit: str) -> Estimate | None:
    return None if value is None else Estimate(AXES, value, covariance, unit)


def _fit(S: FloatArray, b: FloatArray, covariance: FloatArray, solution: Solution, windows: Windows) -> FitToReference:
    used = solution.residual[solution.is_used]
    return FitToReference(
        S=S,
        b=b,
        covariance=np.asarray(covariance[:12, :12]),
        rms=rms_of(used),
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
