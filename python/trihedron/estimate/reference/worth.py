"""What a reference is worth: its own error, its gaps, and whether it was computed from this very gyro."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from trihedron.arrays import FloatArray
from trihedron.estimate.reference.beside import Beside
from trihedron.estimate.reference.motion import MotionFit, fit_motion
from trihedron.records.reference import ReferenceError, Sign
from trihedron.sensor_model import reframing

FINE_S, COARSE = 0.1, 4.0
"""Blocks whose differences show noise from some tenths of a hertz to five; and how much longer ones see S again."""
SQUARE = np.radians(0.01)
"""Nobody mounts a unit within a hundredth of a degree: then the reference's body is the unit's own."""
QUIET_PARTS = 50
"""Part of the log, its quietest fiftieth, whose scatter from sample to sample is no more than noise at rest."""
QUIETER = 0.8
"""The difference holds the gyro's noise, whatever the reference adds; each of the two is told to some per cent."""
CERTAIN = 1e-4
SURPRISE = 1e-6
"""False alarms of a block that stands apart, the number of blocks paid for."""


def error_of(found: MotionFit, k: int = 0) -> ReferenceError:
    """Strengths of the reference's error in recording k, medians over their posterior, and rows that it lacks."""
    problem, draws = found.problems[k], np.exp(found.fitted.draws[:, k])
    middle = np.median(draws, axis=0)
    rows = problem.blocks.rows()
    seen = rows[:, 0] > 0
    time = problem.blocks.time_s()
    slow = np.sqrt(np.sum(draws[:, [3, 5]] ** 2, axis=1))
    is_body = middle[5] > middle[3]
    return ReferenceError(
        white_rad=float(middle[2]),
        slow_rad=(float(np.median(slow)), float(np.quantile(slow, 0.025)), float(np.quantile(slow, 0.975))),
        slow_s=float(middle[6] if is_body else middle[4]),
        is_of_body=bool(is_body),
        rows=int(rows[:, 0].sum()),
        rows_left_out=int(rows[:, 1].sum()),
        gaps_s=_runs(time, ~seen & (np.cumsum(seen) > 0) & (np.cumsum(seen[::-1])[::-1] > 0)),
        apart_s=_runs(time, surprises(found, k) < SURPRISE / max(int(seen.sum()), 1)),
        signs=signs_of_this_gyro(found.sides[k], found, k),
    )


def surprises(found: MotionFit, k: int) -> FloatArray:
    """(m,) probability that a block lies as far from its prediction as it does, the fit being right; 1 without rows."""
    problem = found.problems[k]
    with_ = np.exp(found.fitted.strengths[k]).tolist()
    normal = problem.blocks.normal(problem.table, with_)
    theta = found.fitted.mean[problem.index]
    left = (normal.innovations @ np.append(-theta, 1.0)).reshape(-1, 3)
    # The bias in `mean` is that over time; at the start it is another: the filter's own first blocks take that up.
    return np.asarray(chi2.sf(np.sum(left**2, axis=1), 3))


def _runs(time: FloatArray, where: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Beginning and end of every run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int)))
    last = len(time) - 1
    return tuple((float(time[a]), float(time[min(b, last)])) for a, b in edges.reshape(-1, 2))


def signs_of_this_gyro(side: Beside, found: MotionFit, k: int) -> tuple[Sign, ...]:
    """Signs that the reference was computed from this gyro: S and b are then confirmed by it and not measured."""
    motion = side.reference.motion
    if motion.attitude is None:
        return ()
    out = []
    own, noise = residual_density(side, found, k), noise_at_rest(side, found, k)
    if own < QUIETER * noise:
        out.append(Sign("quieter-than-gyro", float(own), float(noise)))
    cov = found.covariance(k, ("S", "b"))
    change = reframing(found.value(k, "S").reshape(3, 3), found.value(k, "b"), "symmetric")
    cosine = np.clip((np.trace(change.rotation) - 1.0) / 2.0, -1.0, 1.0)
    angle, sigma = float(np.arccos(cosine)), float(np.sqrt(np.trace(change.tilt @ cov @ change.tilt.T) / 3.0))
    if angle < SQUARE + sigma and sigma < SQUARE:
        out.append(Sign("mounted-without-error", angle, sigma))
    coarse = fit_motion([side], block_s=COARSE)
    change_S = coarse.value(0, "S") - found.value(k, "S")
    both = coarse.covariance(0, ("S",)) + found.covariance(k, ("S",))
    far = float(change_S @ np.linalg.solve(both, change_S))
    if chi2.sf(far, 9) < CERTAIN:
        out.append(Sign("S-depends-on-duration", far, 9.0))
    return tuple(out)


def residual_density(side: Beside, found: MotionFit, k: int) -> float:
    """White density [rad/s/√Hz] of the difference between gyro and reference from some tenths of a hertz to five."""
    fine = side.problem(found.points[k], found.places[k], found.wider, FINE_S)
    rows = fine.blocks.rows()[:, 0] > 0
    change = np.diff(fine.observed.reshape(-1, 3), axis=0)[rows[1:] & rows[:-1]]
    # Means over neighbouring blocks of a walk differ by two thirds of what it adds in one; a knock does not move the
    # median of three squares, that of chi-square.
    return float(np.sqrt(np.median(np.sum(change**2, axis=1)) / (2.0 / 3.0 * FINE_S * chi2.median(3))))


def noise_at_rest(side: Beside, found: MotionFit, k: int) -> float:
    """White density of the gyro's own noise where the log is quietest; more than that is motion."""
    rate = side.corrected(found.points[k])
    n = max(len(rate) // QUIET_PARTS, 8)
    change = np.sum(np.diff(rate, axis=0) ** 2, axis=1) / 6.0
    total = np.concatenate([[0.0], np.cumsum(change)])
    return float(np.sqrt((total[n:] - total[:-n]).min() / n * side.grid.step_s))
