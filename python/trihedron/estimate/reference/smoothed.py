"""What moves over a recording, smoothed: the gyro's bias, and the reference's own slow error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.reference.accelerometer import turns
from trihedron.estimate.reference.likelihood import FARTHEST, SPREAD, STRENGTHS, TYPICAL, Together, equations, together
from trihedron.estimate.reference.motion import MotionFit, slow_error
from trihedron.estimate.reference.together import Reference
from trihedron.records.reference import BiasOverTime, ErrorOverTime

BODY = STRENGTHS.index("body")


def bias_over_time(found: MotionFit, k: int) -> BiasOverTime:
    """Bias of recording k in every block, g-sensitivity at the recording's mean specific force included."""
    each = [_bias_at(found, k, strengths) for strengths in found.fitted.draws]
    values = np.array([value for value, _ in each])
    # Of strengths that nobody knows: their mean, and how far the answers lie apart besides.
    variance = np.mean([own for _, own in each], axis=0) + values.var(axis=0)
    return BiasOverTime(found.problems[k].blocks.time_s(), values.mean(axis=0), np.sqrt(variance))


def _bias_at(found: MotionFit, k: int, strengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Value and variance (m, 3) at given strengths (a recording, 7)."""
    side, own, problem = found.sides[k], found.places[k], found.problems[k]
    all_of = posterior(found, strengths)
    mean, cov = all_of.mean[problem.index], all_of.covariance[np.ix_(problem.index, problem.index)]
    columns, beside, _, _ = problem.blocks.smoothed(problem.table, np.exp(strengths[k]).tolist())
    m = len(beside)
    columns = columns.reshape(m, 3, -1)
    change = -columns[:, :, :-1]
    change[:, :, problem.bias] += np.diag(problem.sigma[problem.bias])
    value = found.points[k].b + columns[:, :, -1]
    if side.force is not None and "gyro-g-sensitivity" in own:
        # Bias and g-sensitivity hardly separate where the force keeps its direction; what both add up to is known.
        force = side.force[side.seen].mean(axis=0)
        at = np.flatnonzero(np.isin(problem.index, own["gyro-g-sensitivity"]))
        for i in range(3):
            change[:, i, at[3 * i : 3 * i + 3]] -= force * problem.sigma[at[3 * i : 3 * i + 3]]
        value = value - found.points[k].g @ force
    variance = np.diagonal(beside + change @ cov @ np.swapaxes(change, 1, 2), axis1=1, axis2=2)
    return value + change @ mean, np.maximum(variance, 0.0)


def error_over_time(found: MotionFit, k: int) -> ErrorOverTime:
    """Attitude of the reference of recording k against the gyro's, whose parameters and bias over time are taken off.

    ``angle = observed - columns theta - Σ ΔM Δb``: M is the sum of attitudes that a bias acts through, Δb what the bias
    has walked since the beginning.
    """
    problem = found.problems[k]
    mean = posterior(found, found.fitted.strengths).mean[problem.index]
    strengths = np.exp(found.fitted.strengths[k])
    columns, beside, _, _ = problem.blocks.smoothed(problem.table, strengths.tolist())
    m = len(beside)
    columns = columns.reshape(m, 3, -1)
    walked = columns[:, :, -1] - columns[:, :, :-1] @ mean
    acting = problem.columns.reshape(m, 3, -1)[:, :, problem.bias] / problem.sigma[problem.bias]
    steps = np.einsum("mij,mj->mi", np.diff(acting, axis=0), 0.5 * (walked[1:] + walked[:-1]))
    by_walk = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    angle = (problem.observed - problem.columns @ mean).reshape(m, 3) - by_walk
    angle[problem.blocks.rows()[:, 0] == 0] = np.nan
    walk = float(strengths[STRENGTHS.index("angle_walk")])
    return ErrorOverTime(problem.blocks.time_s(), angle - np.nanmean(angle, axis=0), walk)


def without_slow_error(found: MotionFit, k: int) -> Reference:
    """The reference of recording k, its attitudes turned back by its slow error: gyro and reference together know them
    better than either, and what is left hardly tilts gravity."""
    side, point, problem = found.sides[k], found.points[k], found.problems[k]
    motion = side.reference.motion
    if motion.attitude is None:
        return side.reference
    slow = slow_error(problem, found.fitted.strengths[k], posterior(found, found.fitted.strengths).mean)
    time = (motion.time_s - point.offset_s) / (1.0 + point.rate)
    own = slow.taken_off(time, motion.attitude @ point.mounting) @ point.mounting.T
    return Reference(replace(motion, attitude=np.ascontiguousarray(own)))


def frame_covariance(found: MotionFit, k: int) -> FloatArray:
    """(3, 3) [rad²] of the turn between the body and what recording k's reference shows of it on the whole.

    The mean of a slow error in the body is a mounting like any other: no motion tells it, and it turns both sensors
    alike. It is what the rotation of S is less well known by with that error in the fit.
    """
    side = found.sides[k]
    if side.reference.motion.attitude is None:
        return np.zeros((3, 3))
    at = found.places[k]["S"]
    sigma = found.wider.get("S", 1.0) * side.sigma("S")
    # Turns of the body about each axis as changes of S, and back again by least squares.
    turn = np.linalg.pinv(turns(found.value(k, "S").reshape(3, 3))) * sigma
    out = np.zeros((3, 3))
    for strengths in found.fitted.draws:
        without = strengths.copy()
        without[:, BODY] = (TYPICAL - FARTHEST * SPREAD)[BODY]
        both, alone = (posterior(found, one).covariance[np.ix_(at, at)] for one in (strengths, without))
        values, vectors = np.linalg.eigh(turn @ (both - alone) @ turn.T)
        out += (vectors * np.maximum(values, 0.0)) @ vectors.T / len(found.fitted.draws)
    return out


def posterior(found: MotionFit, strengths: FloatArray) -> Together:
    """All parameters at given strengths, biases those at the start."""
    return together(found.problems, [equations(p, s) for p, s in zip(found.problems, strengths, strict=True)])
