"""Predicted uncertainty of the gyro's parameters from planned turns and moves (the manual's problems 3, 4 and 8)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.records.plan import TurnPlan
from trihedron.transforms import cross_matrix


def design_turns(
    angles_deg: Sequence[float], turn_s: float, static_s: float, noise_density: float, sigma_turn_rad: float = 0.0
) -> TurnPlan:
    """The same turns about every axis, each of ``turn_s``, by rows ``φ'_i = S_w φ_i + b_w Δt_i + δφ_i``.

    With ``v = N² Δt + σ_turn²``, ``Q = Σ φ²/v``, ``P = Σ φ Δt/v`` about one axis and ``T = Σ Δt²/v + Δt_0/N²`` of all:
    ``var S = 1/Q + (P/Q)² var b``. By all rows at once ``var b = 1/(T - 3 P²/Q)`` (the manual's problem 4); with
    ``b_w = φ'_0/Δt_0`` from the static interval first, ``var b = N²/Δt_0`` (problem 3). With the noise in rad/s/√Hz the
    scale is relative and the bias in rad/s. Raises ``InputError`` when there is no turn or a figure is not positive.
    """
    if not 1e-30 < noise_density < 1e30:
        raise InputError(f"a noise density of {noise_density:g} is that of no gyro")
    if sigma_turn_rad < 0.0 or turn_s <= 0.0 or static_s <= 0.0:
        raise InputError("noise and durations must be positive")
    angles = np.radians([angle for angle in angles_deg if angle != 0.0])
    if not len(angles):
        raise InputError("no turn about any axis: give angles other than 0")
    weight = 1.0 / (noise_density**2 * turn_s + sigma_turn_rad**2)
    q, p = weight * float(angles @ angles), weight * turn_s * float(np.sum(angles))
    of_static = static_s / noise_density**2
    bias2, bias_first2 = 1.0 / (of_static + 3.0 * (weight * turn_s**2 * len(angles) - p**2 / q)), 1.0 / of_static
    return TurnPlan(
        n_turns=len(angles),
        angles_deg=tuple(float(angle) for angle in angles_deg if angle != 0.0),
        duration_s=turn_s,
        static_s=static_s,
        scale=math.sqrt(1.0 / q + (p / q) ** 2 * bias2),
        bias=math.sqrt(bias2),
        scale_bias_first=math.sqrt(1.0 / q + (p / q) ** 2 * bias_first2),
        bias_bias_first=math.sqrt(bias_first2),
    )


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
