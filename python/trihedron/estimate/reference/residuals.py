"""Residual rates beside a reference, and a fit to the first part of a log validated on the last."""

from dataclasses import replace

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, rms_of
from trihedron.estimate.attitude import integrate_rate
from trihedron.estimate.reference.beside import Beside, Point, places, without_effects
from trihedron.estimate.reference.coloured import without_outliers
from trihedron.estimate.reference.motion import MotionFit, under
from trihedron.estimate.reference.smoothed import bias_over_time
from trihedron.records.reference import ReplayStage

FINE_S = 0.1
"""Least time between the attitudes whose differences are residual rates: up to 5 Hz."""
HORIZON_S = 10.0
"""Time over which attitude is integrated: some turns of a hand, and a bias of 0.1 °/s adds a degree."""
TRAINED = 0.6
"""Fraction of the time for the fit; the rest is held out."""
LEAST_HELD_OUT_S = 12.0
PARTS = 16
"""Parts of the time of a rate table's commands, every other held out."""
TAUGHT = ("S", "b", "earth")
"""Parameters of the fit to the first part: what a calibration contains, and the Earth's rate."""


def fine_s(side: Beside) -> float:
    """Time between attitudes of residual rates [s]: at least two rows of the reference, for any that is not steps."""
    return FINE_S if side.reference.motion.is_stepwise else max(FINE_S, 2.0 * side.reference.step_s)


def rate_left(side: Beside, point: Point) -> tuple[FloatArray, FloatArray]:
    """Times (n,) and rates (n, 3) [rad/s] of the reference as given less the gyro's at a point, in its body."""
    blocks = side.problem(replace(point, slow=None), places([side], ("S", "b"))[0], {}, fine_s(side)).blocks
    seen = blocks.rows()[:, 0] > 0
    both = seen[1:] & seen[:-1]
    # The mean of a reference's rows is not at the middle of their block.
    apart = np.diff(blocks.time_s())[both, None]
    turned = np.diff(blocks.angle(), axis=0)[both]
    return blocks.time_s()[1:][both], np.einsum("nji,nj->ni", blocks.attitude()[1:][both], turned / apart)


def validated(
    found: MotionFit, k: int, given: tuple[FloatArray, FloatArray] | None
) -> tuple[tuple[ReplayStage, ...], float]:
    """Replays of the last part of recording k: nominal, as ``given``, and by a fit to the first part; and the rms of
    the held-out residual rate of that fit [rad/s]. Neither is known of a short log."""
    side, point = found.sides[k], found.points[k]
    blocks = found.problems[k].blocks
    time_s = blocks.time_s()
    is_stepwise = side.reference.motion.is_stepwise
    seen_s = time_s[blocks.rows()[:, 0] > 0]
    cut_s = seen_s[int(TRAINED * len(seen_s))]
    if seen_s[-1] - cut_s < LEAST_HELD_OUT_S:
        return (), float("nan")

    def is_held(at: FloatArray) -> BoolArray:
        # A table turns about one axis after the other: every other part of its time is held out.
        parts = np.floor(PARTS * (at - time_s[0]) / (time_s[-1] - time_s[0])) % 2.0 == 1.0
        return np.asarray(parts if is_stepwise else at > cut_s)

    first = replace(without_effects(point), lost_s=np.append(point.lost_s, time_s[is_held(time_s)]))
    taught = under([side], [first], TAUGHT, found.fitted.strengths[k : k + 1])
    S, b = taught.value(0, "S").reshape(3, 3), bias_over_time(taught, 0).value[-1]
    times, rates = rate_left(side, replace(without_effects(point), S=S, b=b))
    held = rates[is_held(times)]
    rms = rms_of(held[without_outliers(np.linalg.norm(held, axis=1))])
    if is_stepwise:
        return (), rms
    grid = side.grid
    stages = [("one scale, bias from static poses", _nominal(side, point, S, cut_s))]
    if given is not None:
        # The given parameters have their own frame: the rotation between both is the mounting, not an error.
        u, _, vt = np.linalg.svd(S @ given[0].T)
        turn = (u * np.array([1.0, 1.0, np.linalg.det(u @ vt)])) @ vt
        stages.append(("as given", (grid.gyroscope @ given[0].T + given[1]) @ turn.T))
    stages.append(("by the reference", grid.gyroscope @ S.T + b))
    done = [_replay(name, rate, side, point, cut_s) for name, rate in stages]
    return tuple(stage for stage in done if stage is not None), rms


def _nominal(side: Beside, point: Point, S: FloatArray, cut_s: float) -> FloatArray:
    """Nominal rates (n, 3): one scale for all axes, orthogonal axes, bias from the second with the least rotation."""
    grid = side.grid
    u, s, vt = np.linalg.svd(S)
    n = max(round(1.0 / grid.step_s), 8)
    m = len(grid.gyroscope) // n
    rate = side.reference.rate(grid.time_s * (1.0 + point.rate) + point.offset_s)
    turning = np.linalg.norm(rate[: m * n].reshape(m, n, 3).mean(axis=1), axis=1)
    first = side.seen & (grid.time_s <= cut_s)
    turning[~first[: m * n].reshape(m, n).all(axis=1)] = np.inf
    still = int(np.argmin(turning))
    at_rest = grid.gyroscope[still * n : (still + 1) * n].mean(axis=0)
    return np.asarray((grid.gyroscope - at_rest) @ (float(np.mean(s)) * u @ vt).T)


def _replay(stage: str, rate: FloatArray, side: Beside, point: Point, cut_s: float) -> ReplayStage | None:
    """Rms angle between attitude integrated over ``HORIZON_S`` and the reference's after ``cut_s``; ``None`` where that
    is too short. ``rate`` (n, 3) is in the reference's body."""
    grid, reference = side.grid, side.reference
    time = grid.time_s * (1.0 + point.rate) + point.offset_s
    where = side.seen & reference.covers(time) & (grid.time_s > cut_s)
    n = round(HORIZON_S / grid.step_s)
    bad = np.concatenate([[0], np.cumsum(~where)])
    errors = []
    for start in range(0, len(rate) - n, max(n // 2, 1)):
        if bad[start + n + 1] != bad[start]:
            continue
        here = slice(start, start + n + 1)
        carried = integrate_rate(grid.time_s[here], rate[here], last_only=True)
        C = reference.attitude(time[[start, start + n]]) @ point.mounting
        off = (C[0].T @ C[1]).T @ carried
        errors.append(float(np.arccos(np.clip((np.trace(off) - 1.0) / 2.0, -1.0, 1.0))))
    return ReplayStage(stage, HORIZON_S, rms_of(errors), len(errors)) if errors else None
