"""Everything that a reference says of a log: composition of the room (docs/reference.md)."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt
from scipy.stats import f as f_distribution

from trihedron.arrays import FloatArray
from trihedron.estimate.reference.accelerometer import ForceFit, fit_accelerometer
from trihedron.estimate.reference.clocks import align
from trihedron.estimate.reference.coloured import BLOCKS, Solution
from trihedron.estimate.reference.gyroscope import GyroFit, Signals, fit_gyroscope
from trihedron.estimate.reference.parts import refuse_parts_elsewhere
from trihedron.estimate.reference.remarks import remarks
from trihedron.estimate.reference.replay import replay
from trihedron.estimate.reference.settled import plateaus
from trihedron.estimate.reference.together import Grid, Reference, grid_of
from trihedron.estimate.reference.windows import Windows, windows_on
from trihedron.records import Recording
from trihedron.records.reference import AgainstReference, Estimate, FitToReference, ReferenceMotion, ReplayStage
from trihedron.refused import REFUSALS, RefusedError
from trihedron.sensor_model import reframing
from trihedron.units import rate_to_si

Mask = npt.NDArray[np.bool_]

MOST_WINDOWS = 20_000
"""More windows than this are made longer instead: a log of an hour has them at 0.18 s, which a hand still fills."""
FINEST = 4
"""Samples between windows: a cubic B-spline over 16 samples is summed without error that matters (1e-6)."""
TRAINED = 0.6
"""Part of the time that the replay's fits see; the rest is held out."""
LEAST_HELD_OUT_S = 12.0
FORCE_WINDOW_S = 0.1
"""Forces are compared up to 5 Hz: beyond it a position differentiated twice is noise."""
STRANGERS = 0.6
"""A fit that leaves this part of the reference's rate has found no shared motion, whatever the sizes correlate."""
TURNING = 0.5
"""Part of the rate's rms from which on a row turns: of a session of poses its moves, of a restless hand most."""
TURNED_ROUND = 0.2
"""Beyond this part of the motion left the other direction is tried: shared motion leaves some hundredths."""
_AXES = ("x", "y", "z")


def fit_reference(
    recording: Recording,
    motion: ReferenceMotion,
    gravity_m_s2: float,
    *,
    given: tuple[FloatArray, FloatArray] | None = None,
) -> AgainstReference:
    """Hold a log against known motion.

    ``given`` is a gyro's (S, b) whose replay is shown beside; it lies in a frame of its own, and the turn from there to
    the reference's body is taken from the fit.

    Raises
    ------
    ValueError
        When the two share no motion, the clock jumps, units differ by a factor, frames are mirrored, or the motion is
        too little for 12 numbers.
    """
    grid, reference = grid_of(recording), Reference(motion)
    stamped = _stamped(recording, motion)
    found = align(grid, reference, stamped)
    time = grid.time_s * (1.0 + found.rate) + found.offset_s
    seen = grid.is_valid & reference.covers(time)
    if motion.is_stepwise:
        seen &= plateaus(grid, reference, time)
    windows = _windows(grid, reference, seen)
    clock = 0 if motion.is_stepwise else 2
    gyro = fit_gyroscope(grid, reference, windows, found.offset_s, found.rate, clock=clock)
    reference, gyro, is_turned = _right_way_round(grid, reference, windows, gyro, clock)
    motion = reference.motion
    _refuse_strangers(gyro, motion)
    _refuse_units(recording, gyro, motion)
    _refuse_still(gyro, motion)
    refuse_parts_elsewhere(grid, reference, gyro)
    handedness = float(np.sign(np.linalg.det(gyro.A)))
    spacing = max(windows.spacing, round(FORCE_WINDOW_S / grid.step_s))
    wide = windows_on(seen, grid.step_s, spacing)
    force = fit_accelerometer(grid, reference, wide, gyro.offset_s, gyro.rate, gravity_m_s2, handedness)
    effects = _effects(grid, reference, windows, gyro, force)
    result = AgainstReference(
        kind=motion.kind,
        source=motion.source,
        clock_offset_s=(_offset(gyro, recording, motion), _sigma(gyro, 12) if gyro.is_clock_free else float("nan")),
        clock_middle_s=gyro.middle_s,
        clock_rate_ppm=(1e6 * gyro.rate, 1e6 * _sigma(gyro, 13)) if gyro.has_rate else None,
        overlap_s=float(seen.sum()) * grid.step_s,
        correlation=found.correlation,
        gyroscope=_fit(gyro.A, gyro.a, gyro.solution.covariance, gyro.solution, windows),
        accelerometer=None if force is None else _fit(force.S, force.b, force.covariance, force.solution, wide),
        mounting=_mounting(gyro),
        lever_arm=None
        if force is None or force.arm is None or force.arm_covariance is None
        else Estimate(_AXES, force.arm, force.arm_covariance, "m"),
        vertical=None
        if force is None or force.up is None or force.up_covariance is None
        else Estimate(_AXES, force.up, force.up_covariance, "1"),
        earth_rate=_earth(gyro),
        effects=MappingProxyType(effects),
        replay=() if motion.attitude is None else _held_out(grid, reference, seen, gyro, given),
        residual_time_s=grid.time_s[windows.middle],
        residual_rate=gyro.solution.residual,
    )
    return replace(result, findings=(*motion.findings, *remarks(result, found, is_turned)))


def moves_along(recording: Recording, motion: ReferenceMotion) -> float:
    """Correlation of the turning rates where a log and a reference hold one motion.

    Raises
    ------
    ValueError
        When they do not, or the clock jumps.
    """
    grid, reference = grid_of(recording), Reference(motion)
    found = align(grid, reference, _stamped(recording, motion))
    time = grid.time_s * (1.0 + found.rate) + found.offset_s
    windows = _windows(grid, reference, grid.is_valid & reference.covers(time))
    gyro = fit_gyroscope(grid, reference, windows, found.offset_s, found.rate, clock=1)
    _refuse_strangers(gyro, motion)
    # Laid over each other where hardly anything turns, two logs resemble each other by chance.
    _refuse_still(gyro, motion)
    return found.correlation


def _right_way_round(
    grid: Grid, reference: Reference, windows: Windows, gyro: GyroFit, clock: int
) -> tuple[Reference, GyroFit, bool]:
    """The reference as given, or with attitudes from world to body where only that is the log's motion."""
    attitude = reference.motion.attitude
    if attitude is None or _share_left(gyro) < TURNED_ROUND:
        return reference, gyro, False
    other = Reference(replace(reference.motion, attitude=np.ascontiguousarray(np.swapaxes(attitude, 1, 2))))
    turned = fit_gyroscope(grid, other, windows, gyro.offset_s, gyro.rate, clock=clock)
    if _share_left(turned) < 0.5 * _share_left(gyro):
        return other, turned, True
    return reference, gyro, False


def _share_left(gyro: GyroFit) -> float:
    """What is left over the reference's rate, middle rows (medians: knocks do not decide) of those that turn."""
    turns = gyro.size >= TURNING * float(np.sqrt(np.mean(gyro.size**2)))
    left = np.linalg.norm(gyro.solution.residual, axis=1)[turns]
    return float(np.median(left) / max(float(np.median(gyro.size[turns])), 1e-300))


def _stamped(recording: Recording, motion: ReferenceMotion) -> float | None:
    """What both logs' own stamps say of the offset; ``None`` where they do not count from one epoch."""
    offset = recording.start_epoch_s - motion.start_epoch_s
    return offset if abs(offset) < 0.5 * max(recording.duration_s, motion.time_s[-1]) else None


def _windows(grid: Grid, reference: Reference, seen: Mask) -> Windows:
    spacing = max(FINEST, int(np.ceil(len(grid.time_s) / MOST_WINDOWS)))
    if not reference.motion.is_stepwise:
        spacing = max(spacing, int(np.ceil(2.0 * reference.step_s / grid.step_s)))
    return windows_on(seen, grid.step_s, spacing)


def _sigma(gyro: GyroFit, k: int) -> float:
    return float(np.sqrt(gyro.solution.covariance[k, k]))


def _offset(gyro: GyroFit, recording: Recording, motion: ReferenceMotion) -> float:
    """By how much the reference's stamps run ahead of the log's, in both clocks' own counts if they share an epoch."""
    offset = gyro.offset_s + gyro.rate * gyro.middle_s
    if abs(recording.start_epoch_s - motion.start_epoch_s) > 1e5:
        return offset
    return offset + motion.start_epoch_s - recording.start_epoch_s


def _fit(S: FloatArray, b: FloatArray, covariance: FloatArray, solution: Solution, windows: Windows) -> FitToReference:
    used = solution.residual[solution.is_used]
    return FitToReference(
        S=S,
        b=b,
        covariance=np.asarray(covariance[:12, :12]),
        rms=float(np.sqrt(np.mean(used**2))),
        rms_held_out=solution.rms_held_out,
        band_hz=0.5 / (windows.spacing * windows.step_s),
        n_rows=len(solution.residual),
        n_left_out=int(np.count_nonzero(~solution.is_used)),
        widened=solution.widened,
    )


def _mounting(gyro: GyroFit) -> Estimate:
    """The rotation of the gyro triad's symmetric frame into the reference's body, as a vector [rad]."""
    change = reframing(gyro.A, gyro.a, "symmetric")
    covariance = change.tilt @ gyro.solution.covariance[:12, :12] @ change.tilt.T
    turn = change.rotation.T
    angle = float(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)))
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    size = float(np.linalg.norm(axis))
    if size < 1e-9:
        axis = np.sqrt(np.maximum((np.diag(turn) + 1.0) / 2.0, 0.0)) if angle > 1.0 else np.zeros(3)
        size = 1.0
    return Estimate(_AXES, axis / size * angle if size > 0.0 else axis, covariance, "rad")


def _earth(gyro: GyroFit) -> Estimate | None:
    """The Earth's rate along the axes of the reference's world, where the log tells it."""
    earth = gyro.solution.earth
    return None if earth is None or not earth.is_resolved else Estimate(_AXES, earth.value, earth.covariance, "rad/s")


def _refuse_strangers(gyro: GyroFit, motion: ReferenceMotion) -> None:
    left = _share_left(gyro)
    if left > STRANGERS and not motion.is_stepwise:
        raise RefusedError(
            f"{motion.source}: this reference and the log share no motion: their turning rates look alike in size, but "
            f"no mounting makes them one ({100 * left:.0f} % of the rate is left); name the reference of this very log."
        )


def _refuse_units(recording: Recording, gyro: GyroFit, motion: ReferenceMotion) -> None:
    """A factor of 57.3 or of a power of ten between two that both state their unit is a unit misread."""
    nominal = rate_to_si(recording.gyroscope_unit)
    if nominal is None:
        return
    scale = float(np.exp(np.mean(np.log(np.linalg.svd(gyro.A, compute_uv=False))))) / nominal
    for factor, words in (
        (np.degrees(1.0), "its angles or rates are in deg"),
        (np.radians(1.0), "its angles or rates are in rad"),
        (1000.0, "it is in thousandths"),
        (0.001, "it is in thousandths"),
        (2.0 * np.pi / 60.0, "it is in rpm"),
        (60.0 / (2.0 * np.pi), "it is in rpm"),
        (60.0, "it is in rpm or per minute"),
    ):
        if abs(scale / factor - 1.0) < 0.2:
            raise RefusedError(
                f"{motion.source}: the reference turns {scale:.3g} times as fast as the gyro says: {words}, or the "
                "log's unit is misread; name the unit in its columns ('wx [deg/s]', --reference-columns) or with "
                "--gyro-unit."
            )


def _refuse_still(gyro: GyroFit, motion: ReferenceMotion) -> None:
    sigma = np.sqrt(np.maximum(np.diag(gyro.solution.covariance)[:9], 0.0)).reshape(3, 3)
    size = np.linalg.norm(gyro.A, axis=0)
    weak = [_AXES[j] for j in range(3) if not np.linalg.norm(sigma[:, j]) < 0.5 * size[j]]
    if weak:
        raise RefusedError(
            f"{motion.source}: the log's gyro axis {' and '.join(weak)} hardly turns while the reference is there, and "
            "its scale stays open: turn the unit about every axis (a rate table: one mounting for each)."
        )


def _effects(
    grid: Grid, reference: Reference, windows: Windows, gyro: GyroFit, force: ForceFit | None
) -> dict[str, Estimate]:
    """g-sensitivity and nonlinearity, each fitted beside the 12 numbers on its own."""
    out: dict[str, Estimate] = {}
    scale = np.linalg.norm(gyro.A, axis=0)
    own = (grid.gyroscope + np.linalg.solve(gyro.A, gyro.a)) * scale
    along = gyro.A / scale
    # What the gyro reads too much is taken off what is corrected: coefficients are minus those of the columns.
    bend = Signals(np.column_stack([own**3, own**2]), np.vstack([along.T, along.T]))
    names = [f"cubic {a}" for a in _AXES] + [f"quadratic {a}" for a in _AXES]
    for ident, signals, labels, unit in (
        ("gyro-scale-nonlinearity", bend, names, "1/(rad/s)^2, 1/(rad/s)"),
        ("gyro-g-sensitivity", _by_force(grid, force), [f"{a}{b}" for a in _AXES for b in _AXES], "(rad/s)/(m/s^2)"),
    ):
        if signals is None:
            continue
        try:
            fit = fit_gyroscope(
                grid,
                reference,
                windows,
                gyro.offset_s,
                gyro.rate,
                clock=0,
                extra=signals,
                settled_noise=gyro.solution.model,
            )
        except REFUSALS:
            continue
        value, covariance = -fit.solution.theta[12:], fit.solution.covariance[12:, 12:]
        n = len(value)
        held_out = (gyro.solution.rms_held_out, fit.solution.rms_held_out)
        if not np.all(np.diag(covariance) > 0.0):
            continue
        sigma = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(sigma, sigma) + 1e-9 * np.eye(n)
        distance = float((value / sigma) @ np.linalg.solve(correlation, value / sigma)) / n
        # Blocks of time decide how wide the bars are: their number bounds what may be believed of a large distance.
        p = max(float(f_distribution.sf(distance, n, max(4 * BLOCKS - n, BLOCKS))), 1e-300)
        out[ident] = Estimate(tuple(labels), value, covariance, unit, p, held_out)
    return out


def _by_force(grid: Grid, force: ForceFit | None) -> Signals | None:
    if force is None or grid.accelerometer is None:
        return None
    f = grid.accelerometer @ force.S.T + force.b
    return Signals(np.tile(f, 3), np.repeat(np.eye(3), 3, axis=0))


def _held_out(
    grid: Grid, reference: Reference, seen: Mask, gyro: GyroFit, given: tuple[FloatArray, FloatArray] | None
) -> tuple[ReplayStage, ...]:
    """Replay on the last part of a log by what the first part teaches, and by what was known without the reference."""
    inside = np.flatnonzero(seen)
    cut = inside[int(TRAINED * len(inside))]
    first, last = seen.copy(), seen.copy()
    first[cut:], last[:cut] = False, False
    if last.sum() * grid.step_s < LEAST_HELD_OUT_S:
        return ()
    try:
        taught = fit_gyroscope(grid, reference, _windows(grid, reference, first), gyro.offset_s, gyro.rate, clock=1)
    except REFUSALS:
        return ()
    time = grid.time_s * (1.0 + taught.rate) + taught.offset_s
    stages: list[tuple[str, FloatArray]] = [
        ("one scale, zero from rest", _nominal(grid, taught, reference.rate(time), first))
    ]
    if given is not None:
        # The given numbers lie in a frame of their own: the turn between the two is the mounting, no fault of theirs.
        S, b = given
        u, _, vt = np.linalg.svd(taught.A @ S.T)
        turn = (u * np.array([1.0, 1.0, np.linalg.det(u @ vt)])) @ vt
        stages.append(("as given", (grid.gyroscope @ S.T + b) @ turn.T))
    stages.append(("by the reference", grid.gyroscope @ taught.A.T + taught.a))
    earth = taught.solution.earth
    if earth is not None and earth.is_resolved:
        of_room = reference.attitude(time)
        stages = [(name, rate - np.einsum("nji,j->ni", of_room, earth.value)) for name, rate in stages]
    done = [replay(name, rate, grid, reference, time, last) for name, rate in stages]
    return tuple(stage for stage in done if stage is not None)


def _nominal(grid: Grid, gyro: GyroFit, rate: FloatArray, seen: Mask) -> FloatArray:
    """What a data sheet gives: one scale for all axes, axes square, and the zero read where it stands stillest."""
    u, s, vt = np.linalg.svd(gyro.A)
    A = (u @ vt) * float(np.mean(s))
    n = max(round(1.0 / grid.step_s), 8)
    m = len(grid.gyroscope) // n
    turning = np.linalg.norm(rate[: m * n].reshape(m, n, 3).mean(axis=1), axis=1)
    turning[~seen[: m * n].reshape(m, n).all(axis=1)] = np.inf
    still = int(np.argmin(turning))
    return np.asarray((grid.gyroscope - grid.gyroscope[still * n : (still + 1) * n].mean(axis=0)) @ A.T)
