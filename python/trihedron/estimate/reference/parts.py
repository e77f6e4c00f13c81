"""Parts of a log with another offset of the reference's clock: a clock that jumps late or for a short time."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.reference.clocks import JUMP_S
from trihedron.estimate.reference.gyroscope import GyroFit
from trihedron.estimate.reference.settled import running_mean
from trihedron.estimate.reference.together import Grid, Reference

STRETCH_S, HOP_S = 2.0, 1.0
"""Length and spacing of the stretches: a hand reverses its rotation within two seconds, which determines a lag."""
SMOOTH_S = 0.1
"""Averaging time: a tracker's noise of 0.05 deg is 7 deg/s from row to row and 0.7 deg/s over this time."""
STEP_S = 0.04
SEARCH_S = 2.0
LEFT_AT_ZERO = 0.05
"""Least misfit at lag 0, relative to the stretch's rate²: a jump of 50 ms leaves a tenth for rotation at 1 Hz."""
LEFT_AT_LAG = 0.25
"""Largest misfit at another lag, relative to that at lag 0: noise and knocks are equal at every lag."""
TURNING = 0.2
"""Least rms rate of a stretch, relative to the log's, for a lag."""
FEWEST = 2
"""Consecutive stretches with one lag that prove a jump."""


def refuse_parts_elsewhere(grid: Grid, reference: Reference, gyro: GyroFit) -> None:
    """Check that no part of the reference fits at another lag than the whole.

    The alignment's stretches are 8 s long and use only magnitudes of rates: it excludes a jump in the last seconds as
    another motion, and the fit excludes it as outliers. Raises ``RefusedError`` with the interval and the lag, when
    consecutive stretches have the same other lag.
    """
    if reference.motion.is_stepwise:
        return
    every = max(1, round(STEP_S / grid.step_s))
    step, n_smooth = every * grid.step_s, max(1, round(SMOOTH_S / grid.step_s))
    ahead = round(SEARCH_S / step)
    ours = running_mean(grid.gyroscope @ gyro.A.T + gyro.a, n_smooth)[::every]
    at = grid.time_s[::every]
    around = at[0] + step * np.arange(-ahead, len(at) + ahead) if len(at) else at
    fine = around[:, None] + grid.step_s * (np.arange(n_smooth) - 0.5 * (n_smooth - 1))
    time = fine * (1.0 + gyro.rate) + gyro.offset_s
    covered: BoolArray = np.all(reference.covers(time.ravel()).reshape(time.shape), axis=1)
    theirs = reference.rate(time.ravel()).reshape(*time.shape, 3).mean(axis=1)
    is_valid = grid.is_valid[::every]
    n, hop = round(STRETCH_S / step), max(1, round(HOP_S / step))
    least = TURNING**2 * float(np.mean(np.sum(ours**2, axis=1))) * n
    run: list[tuple[int, int]] = []
    for start in range(0, len(at) - n + 1, hop):
        lag = 0
        if is_valid[start : start + n].all():
            part = slice(start, start + n + 2 * ahead)
            lag = _lag(ours[start : start + n], theirs[part], covered[part], least, JUMP_S / step)
        if lag and (not run or abs(lag - run[-1][1]) <= 1):
            run.append((start, lag))
        elif len(run) >= FEWEST:
            break
        else:
            run = [(start, lag)] if lag else []
    if len(run) >= FEWEST:
        first, last = at[run[0][0]], at[run[-1][0]] + STRETCH_S
        off = step * float(np.median([lag for _, lag in run]))
        raise RefusedError(
            f"{reference.motion.source}: the reference's clock jumps: from {first:.0f} to {last:.0f} s of the log it "
            f"is {off:+.2g} s off the remaining parts; cut the reference there and use the parts one by one."
        )


def _lag(ours: FloatArray, theirs: FloatArray, covered: BoolArray, least: float, jump: float) -> int:
    """Lag of the reference in this stretch, in steps; 0 where lag 0 fits or no lag does."""
    n, ahead = len(ours), (len(theirs) - len(ours)) // 2
    size = float(np.sum(ours**2))
    if size < least or not covered[ahead : ahead + n].all():
        return 0
    products = sum(np.correlate(theirs[:, k], ours[:, k], "valid") for k in range(3))
    ends = np.concatenate(([0.0], np.cumsum(np.sum(theirs**2, axis=1))))
    missed = size + ends[n:] - ends[:-n] - 2.0 * products
    gaps = np.cumsum(np.concatenate(([False], ~covered)), dtype=np.int64)
    missed[gaps[n:] - gaps[:-n] > 0] = np.inf
    zero, lags = float(missed[ahead]), np.arange(-ahead, len(missed) - ahead)
    missed[np.abs(lags) < jump] = np.inf
    best = int(np.argmin(missed))
    return int(lags[best]) if zero > LEFT_AT_ZERO * size and missed[best] < LEFT_AT_LAG * zero else 0
