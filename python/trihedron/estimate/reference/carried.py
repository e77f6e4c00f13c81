"""Uncertainty of attitudes and clock from the gyro's fit, propagated to the accelerometer's parameters.

A clock error δτ rotates the attitudes by ω δτ and shifts the path, and changes the smoothed slow error of the
reference. With errors δφ of the parameters and η of the slow error at known parameters, both from their joint
posterior, the error of an accelerometer parameter is

    h(δφ, η) = (L - Gᵀ V⁻¹ A) δφ + Σ_t H(t) η(t),   var Σ H η = H P Hᵀ - Gᵀ V⁻¹ G,   G = cov(observations, Σ H e)   (1)

A the columns of the attitude's model, V its covariance, P the prior covariance of the slow error, H and L the responses
of the accelerometer's least squares to attitudes and to the clock (docs/reference.md).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import matmul_toeplitz

from trihedron.arrays import FloatArray
from trihedron.estimate.reference.accelerometer import ForceFit, turns, turns_of_frame
from trihedron.estimate.reference.likelihood import STRENGTHS, Problem
from trihedron.estimate.reference.motion import MotionFit
from trihedron.estimate.reference.smoothed import posterior, without_slow_error


def error_carried(found: MotionFit, k: int, force: ForceFit, time_s: FloatArray, frame: FloatArray) -> FloatArray:
    """(n, n) covariance of the n elements of ``force``, fitted in windows about ``time_s`` of the log of recording k.

    It is averaged over the posterior of the strengths. The common rotation of both sensors, with covariance ``frame``
    (3, 3) [rad²], is included in full.
    """
    side, problem, own, point = found.sides[k], found.problems[k], found.places[k], found.points[k]
    direct = np.zeros((len(force.wrt_clock), len(problem.index)))
    if "clock" in own:
        at = np.searchsorted(problem.index, own["clock"])
        since = np.stack([np.ones(len(time_s)), time_s - side.middle_s])
        direct[:, at] = force.wrt_clock @ since.T * problem.sigma[at]
    nodes = None
    if force.wrt_attitude is not None:
        C = without_slow_error(found, k).attitude(time_s * (1.0 + point.rate) + point.offset_s) @ point.mounting
        nodes = _on_nodes(problem, force.wrt_attitude, C, time_s)
    wrong = [_under(found, k, strengths, direct, nodes) for strengths in (found.fitted.strengths, *found.fitted.draws)]
    means = np.array([mean for mean, _ in wrong])
    from_used = means[1:] - means[0]
    covariance = np.mean([one for _, one in wrong[1:]], axis=0) + from_used.T @ from_used / len(from_used)
    return _with_frame(covariance, force, frame)


def _under(
    found: MotionFit, k: int, strengths: FloatArray, direct: FloatArray, nodes: tuple[FloatArray, FloatArray] | None
) -> tuple[FloatArray, FloatArray]:
    """Mean (n,), up to a constant common to all ``strengths`` (a recording, 7), and covariance (n, n) of the errors of
    (1); L is ``direct`` (n, p), ``nodes`` holds H of the world and of the body error, (m, 3, n) each."""
    problem = found.problems[k]
    all_of = posterior(found, strengths)
    mean, cov = all_of.mean[problem.index], all_of.covariance[np.ix_(problem.index, problem.index)]
    if nodes is None:
        return direct @ mean, direct @ cov @ direct.T
    joint, prior = _prior(problem, nodes, np.exp(strengths[k]))
    table = np.ascontiguousarray(np.column_stack([problem.table, joint]))
    gram = problem.blocks.normal(table, np.exp(strengths[k]).tolist()).gram
    p = len(problem.index)
    by_slow, told = gram[p + 1 :, : p + 1], gram[p + 1 :, p + 1 :]
    linear = direct - by_slow[:, :-1]
    return linear @ mean + by_slow[:, -1], linear @ cov @ linear.T + _positive(prior - told)


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
    problem: Problem, wrt_attitude: FloatArray, C: FloatArray, time_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Responses (n, k, 3) to rotations about the world's axes at ``time_s`` (k,), with attitudes ``C``, distributed
    over the two nearest blocks: (m, 3, n) to the world and to the body error."""
    at = problem.blocks.time_s()
    m = len(at)
    place = np.interp(time_s, at, np.arange(m))
    before = np.minimum(place.astype(np.int64), max(m - 2, 0))
    after = (place - before)[:, None, None]
    world, body = np.zeros((m, 3, len(wrt_attitude))), np.zeros((m, 3, len(wrt_attitude)))
    for out, responses in ((world, wrt_attitude), (body, np.einsum("nka,kab->nkb", wrt_attitude, C))):
        each = np.moveaxis(responses, 0, 2)
        np.add.at(out, before, (1.0 - after) * each)
        np.add.at(out, np.minimum(before + 1, m - 1), after * each)
    return world, body


def _with_frame(covariance: FloatArray, force: ForceFit, frame: FloatArray) -> FloatArray:
    """The covariance with at least the contribution of ``frame``, for a positive joint covariance of both sensors."""
    J = np.zeros((len(covariance), 3))
    J[:12] = turns_of_frame(force.S, force.b)
    if force.arm is not None:
        J[-3:] = turns(force.arm[:, None])
    common = J @ frame @ J.T
    return common + _positive(covariance - common)


def _positive(covariance: FloatArray) -> FloatArray:
    """The covariance with negative eigenvalues (rounding errors) set to 0."""
    scale = np.sqrt(np.abs(np.diag(covariance))) + 1e-300
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(root @ root.T)
