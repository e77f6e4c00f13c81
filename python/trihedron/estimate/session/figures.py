"""The published figures of a calibration, in sample and held out: always those of the saved S and b.

Norm of gravity at rest with one bias for the session; gravity carried through each move with a bias per pose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.session.carried import Carried, Linear, carried_each
from trihedron.estimate.session.fit import DYNAMICS, MOVES, STATIC_FORCE, SessionSolution
from trihedron.estimate.session.observed import Observed
from trihedron.records.calibration import FitQuality
from trihedron.session.noise import along_gradient

N_ACCELEROMETER, N_GYROSCOPE = 9, 9


def norm_quality(
    observed: Observed, solution: SessionSolution, held: FloatArray | None, held_sigma: FloatArray | None
) -> FitQuality:
    """Norm of every pose at the saved S, b of the accelerometer; ``held`` (n,) is that of fits without the pose."""
    residual, sigma = norm_errors(observed, solution.S_a, solution.b_a)
    dof = max(len(residual) - N_ACCELEROMETER, 0)
    total, chi2 = float(np.sum(residual**2)), float(np.sum((residual / np.maximum(sigma, 1e-300)) ** 2))
    return FitQuality(
        unit="m/s^2",
        residual=residual,
        sigma=sigma,
        chi2=chi2,
        dof=dof,
        rms=float(np.sqrt(total / len(residual))),
        rms_dof=float(np.sqrt(total / dof)) if dof else float("nan"),
        floor=float(np.sqrt(np.mean(sigma**2))),
        held_out=held,
        held_out_sigma=held_sigma,
        held_out_rms=None if held is None else float(np.sqrt(np.mean(held**2))),
        n_iterations=solution.iterations,
        stopped_because=solution.stopped_because,
        # What one bias for the session misses of a drift is in the covariance.
        covariance_scale=max(chi2 / dof, 1.0) if solution.is_drifting and dof else 1.0,
    )


def norm_errors(observed: Observed, S_a: FloatArray, b_a: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``|S a' + b| - |g|`` (n,) and its noise."""
    force = (observed.pose_force + observed.force_origin) @ S_a.T + b_a
    norm = np.linalg.norm(force, axis=1)
    gain = (force / norm[:, None]) @ S_a
    return norm - observed.gravity_m_s2, along_gradient(observed.pose_force_sigma, observed.force_up, gain)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """What fits without them leave of every pose's norm (n,) with its sigma, and of every move."""

    norm: FloatArray
    norm_sigma: FloatArray
    moves: Carried


def held_out(
    observed: Observed,
    measured: MoveMeasurements,
    anchors_s: FloatArray,
    solution: SessionSolution,
    n_folds: int,
) -> HeldOut | None:
    """Every k-th hold, then every k-th move, left out of the whole fit; ``None`` where too few would remain.

    Strengths of the zeros and widening of the moves are those of the whole session; what the others say is one linear
    step from its optimum (eq. 11.15).
    """
    n, m = len(observed.pose_force), len(observed.before)
    if n_folds < 2 or m - -(-m // n_folds) < N_GYROSCOPE // 2 + 1 or n - -(-n // n_folds) < N_ACCELEROMETER:
        return None
    core = solution.core
    labels = core.labels
    is_reading = labels[:, 3] == 0
    is_pose = is_reading & (labels[:, 0] == STATIC_FORCE)
    is_move = is_reading & ((labels[:, 0] == MOVES) | (labels[:, 0] == DYNAMICS))
    is_of_fold = labels[:, 1] % n_folds == np.arange(n_folds)[:, None]
    rests = core.without(np.concatenate([is_pose & is_of_fold, is_move & is_of_fold]), observed.force_origin)
    norm, norm_sigma = np.full(n, np.nan), np.full(n, np.nan)
    for fold, (S, b, _, covariance) in enumerate(rests[:n_folds]):
        poses = np.arange(n) % n_folds == fold
        residual, noise = norm_errors(observed, S, b - S @ observed.force_origin)
        norm[poses] = residual[poses]
        norm_sigma[poses] = np.sqrt(noise**2 + _of_model(observed, S, b, covariance))[poses]
    number = {int(pose): k for k, pose in enumerate(measured.links[:, 0])}
    which = np.array([number[int(pose)] for pose in observed.before], dtype=np.int64)
    models = [
        Linear(np.flatnonzero(np.arange(m) % n_folds == fold), S, b - S @ observed.force_origin, S_w)
        for fold, (S, b, S_w, _) in enumerate(rests[n_folds:])
    ]
    part = replace(measured, links=measured.links[which], edges=measured.edges[which])
    seen = carried_each(part, anchors_s[which], models)
    return HeldOut(norm, norm_sigma, seen.spread(which, measured.n_moves))


def _of_model(observed: Observed, S: FloatArray, b_centred: FloatArray, covariance: FloatArray) -> FloatArray:
    """(n,) variance of the norm by the model's own uncertainty, ``J C Jᵀ`` with ``J = (u ⊗ a', u)``."""
    force = observed.pose_force @ S.T + b_centred
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    means = observed.pose_force + observed.force_origin
    jacobian = np.concatenate([(up[:, :, None] * means[:, None, :]).reshape(-1, 9), up], axis=1)
    out: FloatArray = np.maximum(np.einsum("ni,ij,nj->n", jacobian, covariance, jacobian), 0.0)
    return out


def move_quality(
    measured: MoveMeasurements, solution: SessionSolution, seen: Carried, held: Carried | None, used: FloatArray
) -> FitQuality:
    """The gyro's residuals in sample and held out; a move is two numbers, so rms is per tangent component."""
    is_used = used > 0.0
    g = np.linalg.norm(measured.reading @ solution.S_a.T + solution.b_a, axis=1).mean()
    n = 2 * int(np.count_nonzero(is_used))
    dof = max(n - N_GYROSCOPE, 0)
    total = float(np.sum((g * np.radians(seen.angle_deg[is_used])) ** 2))
    held_rms = None
    if held is not None:
        known = is_used & np.isfinite(held.angle_deg)
        held_rms = float(np.sqrt(np.sum((g * np.radians(held.angle_deg[known])) ** 2) / (2 * known.sum())))
    return FitQuality(
        unit="m/s^2",
        residual=seen.residual,
        sigma=seen.sigma,
        chi2=solution.moves_chi2,
        dof=round(solution.moves_dof),
        rms=float(np.sqrt(total / n)),
        rms_dof=float(np.sqrt(total / dof)) if dof else float("nan"),
        floor=float(np.sqrt(np.sum(seen.floor2[is_used]) / n)),
        held_out=None if held is None else held.residual,
        held_out_sigma=None if held is None else held.sigma,
        held_out_rms=held_rms,
        angle_deg=seen.angle_deg,
        held_out_angle_deg=None if held is None else held.angle_deg,
        weights=used,
        n_iterations=solution.iterations,
        stopped_because=solution.stopped_because,
    )
