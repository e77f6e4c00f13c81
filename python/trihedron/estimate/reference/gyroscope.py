"""Initial S and b of a gyro and the clock, by windows, for the fit of the whole motion."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, rms_of
from trihedron.errors import INPUT_ERRORS
from trihedron.estimate.attitude import integrate_rate
from trihedron.estimate.reference.beside import Beside
from trihedron.estimate.reference.coloured import NoiseModel, Solution, solve
from trihedron.estimate.reference.together import Grid, Reference, Windows
from trihedron.records import Segments
from trihedron.records.reference import FitToReference, ReplayStage

WHITE = NoiseModel(grows=False, order=0)
TURNS = 6
"""Gauss-Newton steps of the clock: from an error of one sample, three reach a microsecond."""
TURNING_RAD_S = np.radians(0.5)
"""Largest rate in a pose: at a higher one gravity changes by 0.01 g in the body frame within a second."""


@dataclass(frozen=True, eq=False)
class GyroFit:
    """``ω = A w' + a`` and the clock: ``offset_s`` at time 0, ``rate``; in ``solution`` θ is A row by row, a, offset at
    ``middle_s``, rate. ``size`` (k,) is the magnitude of the reference's rate in each window [rad/s]."""

    A: FloatArray
    a: FloatArray
    offset_s: float
    rate: float
    solution: Solution
    middle_s: float
    size: FloatArray

    @property
    def handedness(self) -> float:
        """Sign of det A: -1 where log and reference have frames of opposite handedness."""
        return float(np.sign(np.linalg.det(self.A)))


def fit_gyroscope(
    grid: Grid, reference: Reference, windows: Windows, offset_s: float, rate: float, *, clock: int = 2
) -> GyroFit:
    """Fit ``ω_reference(t (1 + ε) + τ) = A w' + a`` by windows; ``clock`` 0 fixes τ and ε, 1 frees τ, 2 both."""
    middle, index = float(np.mean(grid.time_s[windows.middle])), windows.start // windows.spacing
    target, design = _rows(grid, reference, windows, offset_s, rate)
    size = np.linalg.norm(target, axis=1)
    solution = solve(design, target, index, size, WHITE)
    for _ in range(TURNS if clock else 0):
        half = 0.25 * grid.step_s
        later, earlier = (
            t - d @ solution.theta[:12]
            for t, d in (_rows(grid, reference, windows, offset_s + side * half, rate) for side in (1.0, -1.0))
        )
        by_offset = (earlier - later) / (2.0 * half)
        columns = [by_offset, by_offset * (grid.time_s[windows.middle] - middle)[:, None]][:clock]
        solution = solve(np.concatenate([design, np.stack(columns, axis=2)], axis=2), target, index, size, WHITE)
        moved, rate_change = np.append(solution.theta[12:], 0.0)[:2].tolist()
        # Limited to the uncertainty of the alignment by correlation.
        change = float(np.clip(moved, -0.1, 0.1))
        offset_s += change - rate_change * middle
        rate += rate_change
        if abs(change) < 1e-7 and abs(rate_change) * (grid.time_s[-1] - grid.time_s[0]) < 1e-7:
            break
        target, design = _rows(grid, reference, windows, offset_s, rate)
        size = np.linalg.norm(target, axis=1)
    A, a = solution.theta[:9].reshape(3, 3), solution.theta[9:12]
    return GyroFit(A, a, offset_s, rate, solution, middle, size)


def _rows(
    grid: Grid, reference: Reference, windows: Windows, offset_s: float, rate: float
) -> tuple[FloatArray, FloatArray]:
    """Target (k, 3) and design (k, 3, 12): A row by row, a."""
    time = grid.time_s * (1.0 + rate) + offset_s
    signals = np.column_stack([grid.gyroscope, np.ones(len(time))])
    k, q = len(windows.start), signals.shape[1]
    if reference.motion.attitude is None:
        # Windows have unit area: averages of both sides.
        target = windows.of(windows.weight, reference.rate(time))
        mean = windows.of(windows.weight, signals)
        per = np.zeros((k, 3, 3, q))
        for i in range(3):
            per[:, i, i, :] = mean
    else:
        C = reference.attitude(time)
        back = np.swapaxes(C[windows.middle], 1, 2)
        target = _vector(-back @ windows.of(windows.slope, C))
        moments = windows.of(windows.weight, C[:, :, :, None] * signals[:, None, None, :])
        turned = np.einsum("kab,kbcq->kacq", back, moments)
        # vee of the skew part of R [e]x is ½ (tr R - Rᵀ) e.
        trace = np.einsum("kaaq->kq", turned)
        per = 0.5 * (np.eye(3)[None, :, :, None] * trace[:, None, None, :] - np.swapaxes(turned, 1, 2))
    design = np.zeros((k, 3, 12))
    # A row i, column j: component i of the rate by signal j.
    design[:, :, :9] = per[:, :, :, :3].reshape(k, 3, 9)
    design[:, :, 9:12] = per[:, :, :, 3]
    return target, design


def _vector(D: FloatArray) -> FloatArray:
    """(k, 3) axial vector of the skew part of (k, 3, 3)."""
    out = 0.5 * np.stack([D[:, 2, 1] - D[:, 1, 2], D[:, 0, 2] - D[:, 2, 0], D[:, 1, 0] - D[:, 0, 1]], axis=1)
    return np.asarray(out, dtype=np.float64)


def poses_at_rest(segments: Segments, gyroscope: FitToReference, has_own_bias: bool) -> int:
    """Number of static poses: a vehicle in steady flight has constant readings too, but rotates.

    A reference that is another gyro ``has_own_bias``: the median rate of the poses is then bias, not rotation.
    """
    if segments.gyroscope_mean is None:
        return segments.n_poses
    rate = segments.gyroscope_mean @ gyroscope.S.T + gyroscope.b
    if has_own_bias:
        rate = rate - np.median(rate, axis=0)
    return int(np.count_nonzero(np.linalg.norm(rate, axis=1) < TURNING_RAD_S))


# Attitude integrated from the gyro alone against the reference's, on the held-out part of a log.


HORIZON_S = 10.0
"""Time over which attitude is integrated: some turns of a hand, and a bias of 0.1 °/s adds a degree."""
TRAINED = 0.6
"""Fraction of the time for the fit; the rest is held out."""
LEAST_HELD_OUT_S = 12.0


def held_out(
    side: Beside, seen: BoolArray, gyro: GyroFit, given: tuple[FloatArray, FloatArray] | None,
    windows: Callable[[Grid, Reference, BoolArray], Windows],
) -> tuple[ReplayStage, ...]:  # fmt: skip
    """Replay on the last part of a log: nominal, as ``given``, and calibrated on the first part by the reference."""
    grid, reference = side.grid, side.reference
    inside = np.flatnonzero(seen)
    cut = inside[int(TRAINED * len(inside))]
    first, last = seen.copy(), seen.copy()
    first[cut:], last[:cut] = False, False
    if last.sum() * grid.step_s < LEAST_HELD_OUT_S:
        return ()
    try:
        taught = fit_gyroscope(grid, reference, windows(grid, reference, first), gyro.offset_s, gyro.rate, clock=1)
    except INPUT_ERRORS:
        return ()
    time = grid.time_s * (1.0 + taught.rate) + taught.offset_s
    stages: list[tuple[str, FloatArray]] = [
        ("one scale, bias from static poses", _nominal(grid, taught, reference.rate(time), first))
    ]
    if given is not None:
        # The given parameters have their own frame: the rotation between both is the mounting, not an error.
        S, b = given
        u, _, vt = np.linalg.svd(taught.A @ S.T)
        turn = (u * np.array([1.0, 1.0, np.linalg.det(u @ vt)])) @ vt
        stages.append(("as given", (grid.gyroscope @ S.T + b) @ turn.T))
    stages.append(("by the reference", grid.gyroscope @ taught.A.T + taught.a))
    done = [replay(name, rate, grid, reference, time, last) for name, rate in stages]
    return tuple(stage for stage in done if stage is not None)


def _nominal(grid: Grid, gyro: GyroFit, rate: FloatArray, seen: BoolArray) -> FloatArray:
    """Nominal rates (n, 3): one scale for all axes, orthogonal axes, bias from the second with the least rotation."""
    u, s, vt = np.linalg.svd(gyro.A)
    A = (u @ vt) * float(np.mean(s))
    n = max(round(1.0 / grid.step_s), 8)
    m = len(grid.gyroscope) // n
    turning = np.linalg.norm(rate[: m * n].reshape(m, n, 3).mean(axis=1), axis=1)
    turning[~seen[: m * n].reshape(m, n).all(axis=1)] = np.inf
    still = int(np.argmin(turning))
    return np.asarray((grid.gyroscope - grid.gyroscope[still * n : (still + 1) * n].mean(axis=0)) @ A.T)


def replay(
    stage: str, rate: FloatArray, grid: Grid, reference: Reference, time: FloatArray, where: BoolArray
) -> ReplayStage | None:
    """Rms angle between attitude integrated over ``HORIZON_S`` and the reference's.

    ``rate`` (n, 3) is in the reference's body, ``where`` (n,) the part to use; ``None`` where it is too short.
    """
    n = round(HORIZON_S / grid.step_s)
    bad = np.concatenate([[0], np.cumsum(~where)])
    errors = []
    for start in range(0, len(rate) - n, max(n // 2, 1)):
        if bad[start + n + 1] != bad[start]:
            continue
        here = slice(start, start + n + 1)
        carried = integrate_rate(grid.time_s[here], rate[here], last_only=True)
        C = reference.attitude(time[[start, start + n]])
        off = (C[0].T @ C[1]).T @ carried
        errors.append(float(np.arccos(np.clip((np.trace(off) - 1.0) / 2.0, -1.0, 1.0))))
    if not errors:
        return None
    return ReplayStage(stage, HORIZON_S, rms_of(errors), len(errors))
