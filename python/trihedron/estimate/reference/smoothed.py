"""Smoothed estimates over a recording: the gyro's bias, and the reference's slow error."""

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
    # Averaged over the posterior of the strengths; the scatter over the draws is added to the variance.
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
        # Bias and g-sensitivity are hardly separable where the force keeps its direction; their sum is determined.
        force = side.force[side.seen].mean(axis=0)
        at = np.flatnonzero(np.isin(problem.index, own["gyro-g-sensitivity"]))
        for i in range(3):
            change[:, i, at[3 * i : 3 * i + 3]] -= force * problem.sigma[at[3 * i : 3 * i + 3]]
        value = value - found.points[k].g @ force
    variance = np.diagonal(beside + change @ cov @ np.swapaxes(change, 1, 2), axis1=1, axis2=2)
    return value + change @ mean, np.maximum(variance, 0.0)


def error_over_time(found: MotionFit, k: int) -> ErrorOverTime:
    """Attitude of the reference of recording k relative to the gyro's, after subtraction of parameters and bias drift.

    ``angle = observed - columns theta - Σ ΔM Δb``: M is the derivative of the angle by a constant bias, Δb the change
    of the bias since the start.
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
    """The reference of recording k with its slow error subtracted from its attitudes: gyro and reference together
    determine them better than either, and the remaining tilt error is small."""
    side, point, problem = found.sides[k], found.points[k], found.problems[k]
    motion = side.reference.motion
    if motion.attitude is None:
        return side.reference
    slow = slow_error(problem, found.fitted.strengths[k], posterior(found, found.fitted.strengths).mean)
    time = (motion.time_s - point.offset_s) / (1.0 + point.rate)
    own = slow.compensated(time, motion.attitude @ point.mounting) @ point.mounting.T
    return Reference(replace(motion, attitude=np.ascontiguousarray(own)))


def frame_covariance(found: MotionFit, k: int) -> FloatArray:
    """Covariance (3, 3) [rad²] of the rotation between the body and the mean body frame of recording k's reference.

    The mean of a slow error in the body frame is equivalent to a mounting: no motion determines it, and it rotates both
    sensors equally. It is the increase of the covariance of the rotation of S by that error.
    """
    side = found.sides[k]
    if side.reference.motion.attitude is None:
        return np.zeros((3, 3))
    at = found.places[k]["S"]
    sigma = found.wider.get("S", 1.0) * side.sigma("S")
    # Pseudoinverse of the change of S by rotations of the body about each axis.
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
    """Posterior of all parameters at given strengths; biases are those at the start."""
    return together(found.problems, [equations(p, s) for p, s in zip(found.problems, strengths, strict=True)])
