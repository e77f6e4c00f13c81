"""Attitude integrated from the gyro alone against the reference's, on the held-out part of a log."""

from collections.abc import Callable

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.errors import INPUT_ERRORS
from trihedron.estimate.attitude import integrate_rate
from trihedron.estimate.reference.beside import Beside
from trihedron.estimate.reference.gyroscope import GyroFit, fit_gyroscope
from trihedron.estimate.reference.together import Grid, Reference, Windows
from trihedron.records.reference import ReplayStage

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
    return ReplayStage(stage, HORIZON_S, float(np.sqrt(np.mean(np.square(errors)))), len(errors))
