"""An accelerometer whose bias settles after every move, alike in all poses (docs/segmentation.md, section 4)."""

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.probability import fdtrc
from trihedron.segment.channels import Channels
from trihedron.segment.runs import Run
from trihedron.session.drift import TYPICAL
from trihedron.units import STANDARD_GRAVITY_M_S2

TIME_CONSTANTS_S = (0.7, 1.4, 2.8, 5.6)
"""Faster ones are over before a pose counts as static, slower ones are a drift."""
FALSE_ALARM = 1e-3
"""Probability, over all time constants, that the bias of a sound sensor is found to settle."""
FEWEST_POSES = 9
"""Three components, and twice as many poses that show how much the decay scatters from pose to pose."""
FEWEST_BLOCKS = 4
"""Blocks of a pose: fewer have no shape."""


@dataclass(frozen=True, eq=False)
class SettlingBias:
    """Bias change ``size`` (3,) [|g|] at the end of a move with its ``sigma`` (3,), which decays with ``tau_s``; its
    mean over the poses is ``share`` of that. ``p_value`` that the bias of no pose settles."""

    size: FloatArray
    sigma: FloatArray
    tau_s: float
    share: float
    p_value: float


def find_settling_bias(upward: Channels, runs: list[Run], up: FloatArray, gravity: float) -> SettlingBias | None:
    """The likeliest decay after moves in blocks ``upward`` along the verticals ``up`` (h, 3), if any is significant.

    Along the vertical the tilt of a yielding support does not show, and noise of any colour has no direction in time:
    its decay is zero on average. Beside it a drift of the usual size of parts that warm up is an unknown. ``gravity``
    is the raw reading of |g|.
    """
    found = [
        one for tau in TIME_CONSTANTS_S if (one := _with_time_constant(upward, runs, up, tau, gravity)) is not None
    ]
    best = min(found, key=lambda one: one.p_value, default=None)
    return best if best is not None and best.p_value * len(TIME_CONSTANTS_S) < FALSE_ALARM else None


def _with_time_constant(
    upward: Channels, runs: list[Run], up: FloatArray, tau: float, gravity: float
) -> SettlingBias | None:
    # The first pose follows no move.
    reading, length, slope, share = np.zeros((4, len(runs)))
    for i, run in enumerate(runs[1:], 1):
        blocks = np.concatenate([np.arange(a, b) for a, b in run.quiet_ranges()])
        blocks = blocks[upward.is_valid[blocks]]
        if len(blocks) < FEWEST_BLOCKS or run.is_unsteady:
            continue
        x = (blocks - run.outer_first + 0.5) * upward.step_s
        decay = np.exp(-x / tau)
        change = decay - decay.mean()
        length[i], share[i] = np.linalg.norm(change), decay.mean()
        reading[i], slope[i] = (change @ upward.mean[blocks, 0], change @ x) / length[i]
    used = length > 0.0
    n, dof = int(used.sum()), int(used.sum()) - 3
    if n < FEWEST_POSES:
        return None
    settles, drifts = ((up * column[:, None])[used] for column in (length, slope))
    noise = float(np.sqrt(_squares_beside(reading[used], settles) / dof))
    if noise <= 0.0 or np.linalg.matrix_rank(settles) < 3:
        return None
    lasts_s = (runs[-1].last - runs[0].first) * upward.step_s
    drift_size = TYPICAL[0] / STANDARD_GRAVITY_M_S2 * gravity / lasts_s
    # The drift's prior is three more rows.
    rows = np.vstack([np.hstack([settles, drifts]), np.hstack([np.zeros((3, 3)), noise / drift_size * np.eye(3)])])
    y = np.append(reading[used], np.zeros(3))
    left, without = (_squares_beside(y, columns) for columns in (rows, rows[:, 3:]))
    inverse = np.linalg.pinv(rows)[:3] / gravity
    sigma = np.linalg.norm(inverse, axis=1) * np.sqrt(left / dof)
    p = fdtrc(3, dof, (without - left) / 3.0 / (left / dof))
    return SettlingBias(inverse @ y, sigma, tau, float(share[used].mean()), p)


def _squares_beside(y: FloatArray, columns: FloatArray) -> float:
    return float(((y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]) ** 2).sum())
