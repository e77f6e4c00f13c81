"""Predicted uncertainty of the gyro's parameters from planned turns and moves (the manual's problems 3, 4 and 8)."""

import math
from collections.abc import Sequence

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.records.plan import TurnPlan
from trihedron.transforms import cross_matrix, rotation_by


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


Move = tuple[FloatArray, FloatArray]
"""Direction of "up" (3,) before a move, and its rotation vector (3,) [rad], both in the body frame."""


def design_moves(moves: Sequence[Move], sigma_rad: float) -> tuple[int, float]:
    """Rank of the nine elements of ``S_ω`` by planned moves, and the largest relative standard uncertainty of one.

    The tilt error after a move has two components of noise ``sigma_rad`` each (5.7). Three turns about horizontal axes
    determine six elements; nine need a stop in each turn.
    """
    # A room-fixed vector rotates by the opposite angle in the body frame.
    rows = [rows_of_move(turn[None], rotation_by(turn).T @ up) for up, turn in moves]
    singular, directions = np.linalg.svd(np.concatenate(rows) / sigma_rad)[1:]
    rank = int(np.sum(singular > 1e-9 * singular[0]))
    if rank < 9:
        return rank, math.inf
    covariance = (directions[:9].T / singular[:9] ** 2) @ directions[:9]
    return rank, math.sqrt(float(np.max(np.diag(covariance))))


def rows_of_move(path: FloatArray, up_after: FloatArray) -> FloatArray:
    """(3, 9) derivative of the tilt after a move [rad] by the gyro's relative errors, row by row.

    Of each part of the path (k, 3), a rotation ``θ n``, a rate error ``E n θ'`` rotates the body by ``A(θ) E n``,
    ``A = ∫₀^θ exp(-[n]× s) ds = θ n nᵀ + sin θ (1 - n nᵀ) - (1 - cos θ) [n]×``; the tilt error is ``u × ε``.
    """
    rotation, total = np.eye(3), np.zeros((3, 9))
    for part in path[::-1]:
        angle = float(np.linalg.norm(part))
        n = part / (angle or 1.0)
        along = np.outer(n, n)
        gain = angle * along + math.sin(angle) * (np.eye(3) - along) - (1.0 - math.cos(angle)) * cross_matrix(n)
        total += np.kron(rotation @ gain, n)
        rotation = rotation @ rotation_by(part).T
    return cross_matrix(up_after) @ total
