"""Smoothed estimates over a recording: the gyro's bias, and the reference's slow error; their uncertainty, propagated
to the accelerometer's parameters.

A clock error δτ rotates the attitudes by ω δτ and shifts the path, and changes the smoothed slow error of the
reference. With errors δφ of the parameters and η of the slow error at known parameters, both from their joint
posterior, the error of an accelerometer parameter is

    h(δφ, η) = (L - Gᵀ V⁻¹ A) δφ + Σ_t H(t) η(t),   var Σ H η = H P Hᵀ - Gᵀ V⁻¹ G,   G = cov(observations, Σ H e)   (1)

A the columns of the attitude's model, V its covariance, P the prior covariance of the slow error, H and L the responses
of the accelerometer's least squares to attitudes and to the clock (docs/reference.md).
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import matmul_toeplitz

from trihedron.arrays import TINY, FloatArray
from trihedron.estimate.reference.accelerometer import ForceFit
from trihedron.estimate.reference.beside import SlowError
from trihedron.estimate.reference.likelihood import STRENGTHS, Problem, together
from trihedron.estimate.reference.motion import MotionFit, slow_error
from trihedron.estimate.reference.together import Reference
from trihedron.records.reference import BiasOverTime, ErrorOverTime

GYRO = ("S", "b")
"""Parameters of the gyro in a calibration."""


def bias_over_time(found: MotionFit, k: int) -> BiasOverTime:
    """Bias of recording k in every block, g-sensitivity at the recording's mean specific force included."""
    each = [_bias_at(found, k, strengths) for strengths in found.fitted.draws]
    values = np.array([value for value, _ in each])
    # Averaged over the posterior of the strengths; the scatter over the draws is added to the variance.
    variance = np.mean([own for _, own in each], axis=0) + values.var(axis=0)
    return BiasOverTime(found.problems[k].blocks.time_s(), values.mean(axis=0), np.sqrt(variance))


def _bias_at(found: MotionFit, k: int, strengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Value and variance (m, 3) at given strengths (a recording, 8)."""
    side, own, problem = found.sides[k], found.places[k], found.problems[k]
    all_of = together(found.problems, strengths)
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
    """Smoothed slow error of the reference's attitude in recording k, along the axes of its world."""
    blocks, slow = found.problems[k].blocks, _slow_error(found, k)
    angle = slow.world + np.einsum("mij,mj->mi", blocks.attitude(), slow.body)
    angle[blocks.rows()[:, 0] == 0] = np.nan
    return ErrorOverTime(slow.time_s, angle)


def _slow_error(found: MotionFit, k: int) -> SlowError:
    mean = together(found.problems, found.fitted.strengths).mean
    return slow_error(found.problems[k], found.fitted.strengths[k], mean)


def without_slow_error(found: MotionFit, k: int) -> Reference:
    """The reference of recording k with its slow error subtracted from its attitudes: gyro and reference together
    determine them better than either, and the remaining tilt error is small."""
    side, motion = found.sides[k], found.sides[k].reference.motion
    if motion.attitude is None:
        return side.reference
    point = replace(found.points[k], slow=_slow_error(found, k))
    own = side.attitudes(point)[1] @ point.mounting.T
    return Reference(replace(motion, attitude=np.ascontiguousarray(own)))


def error_carried(found: MotionFit, k: int, force: ForceFit, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Covariance (n, n) of the n elements of ``force``, fitted in windows about ``time_s`` of the log of recording k,
    and (n, 12) with the gyro's S row by row and b.

    They are averaged over the posterior of the strengths. The mean of a slow error in the body frame is equivalent to a
    mounting: no motion determines it, and it rotates both sensors alike.
    """
    side, problem, own = found.sides[k], found.problems[k], found.places[k]
    direct = np.zeros((len(force.wrt_clock), len(problem.index)))
    if "clock" in own:
        at = np.searchsorted(problem.index, own["clock"])
        since = np.stack([np.ones(len(time_s)), time_s - side.middle_s])
        direct[:, at] = force.wrt_clock @ since.T * problem.sigma[at]
    nodes = None if force.wrt_attitude is None else _on_nodes(problem, force.wrt_attitude, time_s)
    used, *drawn = (
        _under(found, k, strengths, direct, nodes) for strengths in (found.fitted.strengths, *found.fitted.draws)
    )
    means = np.array([mean for mean, _ in drawn])
    joint = np.mean([one for _, one in drawn], axis=0) + np.cov(means.T, bias=True)
    n = len(direct)
    off = (means.mean(axis=0) - used[0])[:n]
    of_gyro = np.concatenate([side.sigma(name, found.wider) for name in GYRO])
    return joint[:n, :n] + np.outer(off, off), joint[:n, n:] * of_gyro


def _under(
    found: MotionFit, k: int, strengths: FloatArray, direct: FloatArray, nodes: tuple[FloatArray, FloatArray] | None
) -> tuple[FloatArray, FloatArray]:
    """Mean (n + 12,), up to a constant common to all ``strengths`` (a recording, 8), and covariance of the errors of
    (1) and of the gyro's S and b; L is ``direct`` (n, p), ``nodes`` holds H of the world and of the body error,
    (m, 3, n) each."""
    problem = found.problems[k]
    all_of = together(found.problems, strengths)
    gyro = np.concatenate([found.places[k][name] for name in GYRO])
    n, p = direct.shape
    linear = np.vstack([np.zeros((n, len(all_of.mean))), all_of.change[gyro]])
    linear[:n, problem.index] = direct
    alone, shift = np.zeros((n + 12, n + 12)), np.append(np.zeros(n), all_of.shift[gyro])
    alone[n:, n:] = all_of.added[np.ix_(gyro, gyro)]
    if nodes is not None:
        joint, prior = _prior(problem, nodes, np.exp(strengths[k]))
        table = np.ascontiguousarray(np.column_stack([problem.table, joint]))
        gram = problem.blocks.normal(table, np.exp(strengths[k]).tolist()).gram
        linear[:n, problem.index] -= gram[p + 1 :, :p]
        shift[:n] = gram[p + 1 :, p]
        alone[:n, :n] = _positive(prior - gram[p + 1 :, p + 1 :])
    return linear @ all_of.mean + shift, linear @ all_of.covariance @ linear.T + alone


def _prior(
    problem: Problem, nodes: tuple[FloatArray, FloatArray], strengths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """``G`` (3 m, n) and ``H P Hᵀ`` (n, n) of (1) under the prior of the slow error."""
    at = problem.blocks.time_s()
    m, n = len(at), nodes[0].shape[2]
    step_s = (at[-1] - at[0]) / max(m - 1, 1)
    joint, prior = np.zeros((m, 3, n)), np.zeros((n, n))
    for name, H in zip(("world", "body"), nodes, strict=True):
        sigma, lasting_s = (strengths[STRENGTHS.index(one)] for one in (name, f"{name}_s"))
        x = np.sqrt(3.0) * step_s * np.arange(m) / lasting_s
        PH = matmul_toeplitz(sigma**2 * (1.0 + x) * np.exp(-x), H.reshape(m, -1)).reshape(m, 3, n)
        prior += np.einsum("man,mab->nb", H, PH)
        joint += PH if name == "world" else problem.blocks.attitude() @ PH
    return joint.reshape(3 * m, n), prior


def _on_nodes(
    problem: Problem, wrt_attitude: tuple[FloatArray, FloatArray], time_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Responses (n, k, 3) to the world and to the body error at ``time_s`` (k,), distributed over the two nearest
    blocks: (m, 3, n) each."""
    at = problem.blocks.time_s()
    m = len(at)
    place = np.interp(time_s, at, np.arange(m))
    before = np.minimum(place.astype(np.int64), max(m - 2, 0))
    after = (place - before)[:, None, None]

    def on_nodes(responses: FloatArray) -> FloatArray:
        out, each = np.zeros((m, 3, len(responses))), np.moveaxis(responses, 0, 2)
        np.add.at(out, before, (1.0 - after) * each)
        np.add.at(out, np.minimum(before + 1, m - 1), after * each)
        return out

    return on_nodes(wrt_attitude[0]), on_nodes(wrt_attitude[1])


def _positive(covariance: FloatArray) -> FloatArray:
    """The covariance with negative eigenvalues (rounding errors) set to 0."""
    scale = np.sqrt(np.abs(np.diag(covariance))) + TINY
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(root @ root.T)
