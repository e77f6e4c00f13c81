"""Predicted uncertainty of the gyro's parameters from planned turns and moves (the manual's problems 3, 4 and 8)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import XYZ, FloatArray
from trihedron.errors import RefusedError
from trihedron.transforms import cross_matrix


@dataclass(frozen=True, eq=False)
class TurnDesign:
    """Standard uncertainties: ``scale`` (3,) of the elements of each column of ``S_w``, ``bias`` of ``b_w``, in the
    unit of the noise. With the noise in rad/s/√Hz, ``scale`` is relative and ``bias`` in rad/s."""

    scale: FloatArray
    bias: float


def design_least_squares(
    axes: Sequence[int],
    angles_rad: Sequence[float],
    durations_s: Sequence[float],
    static_s: float,
    noise_density: float,
    sigma_turn_rad: float = 0.0,
) -> TurnDesign:
    """All rows ``φ'_i = S_w φ_i + b_w Δt_i + δφ_i`` at once: the manual's problem 4.

    With ``v_i = N² Δt_i + σ_turn²``, ``Q_j = Σ φ²/v``, ``P_j = Σ φ Δt/v`` over the turns about axis j, and ``T = Σ
    Δt²/v + Δt_0/N²``: ``var b = 1/(T - Σ_j P_j²/Q_j)`` and ``var S_j = 1/Q_j + (P_j/Q_j)² var b``. Raises
    ``RefusedError`` when the turns do not determine an axis, or the bias is not determined.
    """
    if not 1e-30 < noise_density < 1e30:
        raise RefusedError(f"a noise density of {noise_density:g} is that of no gyro")
    q, p, t = _sums(axes, angles_rad, durations_s, noise_density, sigma_turn_rad)
    information = t + static_s / noise_density**2 - float(np.sum(p**2 / q))
    if not information > 1e-12 * (t + static_s / noise_density**2):
        raise RefusedError("nothing determines the bias: turn there and back, or keep still for some seconds")
    var_bias = 1.0 / information
    return TurnDesign(np.sqrt(1.0 / q + (p / q) ** 2 * var_bias), math.sqrt(var_bias))


def design_bias_first(
    axes: Sequence[int],
    angles_rad: Sequence[float],
    durations_s: Sequence[float],
    static_s: float,
    noise_density: float,
    sigma_turn_rad: float = 0.0,
) -> TurnDesign:
    """``b_w = φ'_0/Δt_0`` from the static interval, then ``S_w`` from the turns less that bias: the manual's problem 3.

    ``var b = N²/Δt_0``, ``var S_j = 1/Q_j + (P_j/Q_j)² N²/Δt_0``; for one turn ``N² Δt (1 + Δt/Δt_0)/φ²``. Raises
    ``RefusedError`` when the turns do not determine an axis, or there is no static interval.
    """
    q, p, _ = _sums(axes, angles_rad, durations_s, noise_density, sigma_turn_rad)
    if not static_s > 0.0:
        raise RefusedError("this route needs a stretch without rotation: keep still for some seconds")
    var_bias = noise_density**2 / static_s
    return TurnDesign(np.sqrt(1.0 / q + (p / q) ** 2 * var_bias), math.sqrt(var_bias))


def _sums(
    axes: Sequence[int],
    angles_rad: Sequence[float],
    durations_s: Sequence[float],
    noise_density: float,
    sigma_turn_rad: float,
) -> tuple[FloatArray, FloatArray, float]:
    if not noise_density > 0.0 or sigma_turn_rad < 0.0 or min(durations_s, default=0.0) <= 0.0:
        raise RefusedError("noise and durations must be positive")
    which, angle, time = np.asarray(axes), np.asarray(angles_rad), np.asarray(durations_s)
    weight = 1.0 / (noise_density**2 * time + sigma_turn_rad**2)
    q = np.array([float(np.sum((weight * angle**2)[which == axis])) for axis in range(3)])
    p = np.array([float(np.sum((weight * angle * time)[which == axis])) for axis in range(3)])
    if np.any(q <= 0.0):
        missing = " and ".join(XYZ[axis] for axis in np.flatnonzero(q <= 0.0))
        raise RefusedError(f"no turn about {missing}: each axis needs one of its own")
    return q, p, float(np.sum(weight * time**2))


@dataclass(frozen=True, eq=False)
class PlannedMove:
    """A rotation by ``angle_rad`` about ``axis`` (3,), from the pose in which ``up`` (3,) is vertical; body frame."""

    up: FloatArray
    axis: FloatArray
    angle_rad: float


def design_moves(moves: Sequence[PlannedMove], sigma_rad: float) -> tuple[int, float]:
    """Rank of the nine elements of ``S_ω`` by planned moves, and the largest relative standard uncertainty of one.

    A rate error ``δS n θ'`` rotates the body by ``ε = A(θ) δS n``, ``A = ∫₀^θ exp(-[n]× s) ds =
    θ n nᵀ + sin θ (1 - n nᵀ) - (1 - cos θ) [n]×``; the tilt error after the move is ``u × ε``, two components of noise
    ``sigma_rad`` each (5.7). Three turns about horizontal axes determine six elements; nine need a stop in each turn.
    """
    rows = []
    for move in moves:
        n, angle = move.axis / np.linalg.norm(move.axis), move.angle_rad
        cross = cross_matrix(n)
        along = np.outer(n, n)
        gain = angle * along + math.sin(angle) * (np.eye(3) - along) - (1.0 - math.cos(angle)) * cross
        # A room-fixed vector rotates by -θ in the body frame.
        turned = along + math.cos(angle) * (np.eye(3) - along) - math.sin(angle) * cross
        up = turned @ (move.up / np.linalg.norm(move.up))
        rows.append(np.kron(cross_matrix(up) @ gain, n[None, :]))
    matrix = np.concatenate(rows) / sigma_rad
    singular, directions = np.linalg.svd(matrix)[1:]
    rank = int(np.sum(singular > 1e-9 * singular[0]))
    if rank < 9:
        return rank, math.inf
    covariance = (directions[:9].T / singular[:9] ** 2) @ directions[:9]
    return rank, math.sqrt(float(np.max(np.diag(covariance))))
