"""Numbers of a calibration that do not depend on the choice of its frame (docs/diagnosis-method.md, section 9).

Two sessions have each their own lower frame, and ``S_r S_m⁻¹`` leaks from one number into another: a pure change in
scale lights up the off-diagonals. In the distort direction ``M = S⁻¹`` rows are ``k_i n_i``: sensitivity k of axis i
and its unit vector n. Scales, zeros along the own axis and angles between axes are then the same in every frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

PAIRS = ((0, 1), (0, 2), (1, 2))
STEP = 1e-6
"""Relative step of the central differences: their error is its square, 1e-12, and rounding 1e-10 of the value."""


@dataclass(frozen=True, eq=False)
class Invariants:
    """``zero`` (3,) [SI] along each axis, ``log_scale`` (3,) ln of raw units per SI, ``angle`` (3,) [rad] between axes
    (1,2), (1,3), (2,3), ``axes`` (3, 3) rows n_i in the model's own frame."""

    zero: FloatArray
    log_scale: FloatArray
    angle: FloatArray
    axes: FloatArray

    def vector(self) -> FloatArray:
        """(9,) zero, log_scale, angle."""
        return np.concatenate([self.zero, self.log_scale, self.angle])


def invariants(S: FloatArray, b: FloatArray) -> Invariants:
    """Equation 9.1: ``M = S⁻¹``, ``k_i = |M_i|``, ``n_i = M_i/k_i``, ``zero_i = -(M b)_i/k_i``."""
    M = np.linalg.inv(S)
    k = np.linalg.norm(M, axis=1)
    n = M / k[:, None]
    angle = np.array([np.arccos(np.clip(n[i] @ n[j], -1.0, 1.0)) for i, j in PAIRS])
    return Invariants(-(M @ b) / k, np.log(k), angle, n)


def polar_rotation(axes: FloatArray) -> FloatArray:
    """(3, 3) the orthogonal matrix nearest to a triad of unit rows."""
    u, _, vt = np.linalg.svd(axes)
    out: FloatArray = u @ vt
    return out


def triad_rotation(accel: Invariants, gyro: Invariants) -> FloatArray:
    """(3, 3) ``U_g U_aᵀ``: the gyro triad as seen from the accelerometer triad, the same in every frame."""
    out: FloatArray = polar_rotation(gyro.axes) @ polar_rotation(accel.axes).T
    return out


def rotation_vector(R: FloatArray) -> FloatArray:
    """(3,) logarithm of a rotation, |angle| < π; of a reflection that of its negative, so that it stays finite."""
    R = R * np.sign(np.linalg.det(R))
    cosine = np.clip(0.5 * (np.trace(R) - 1.0), -1.0, 1.0)
    angle = float(np.arccos(cosine))
    skew = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    if angle < 1e-6:
        return skew
    sine = float(np.sin(angle))
    out: FloatArray = skew * (angle / sine if sine > 1e-9 else 1.0)
    return out


def jacobian(S: FloatArray, b: FloatArray) -> FloatArray:
    """(9, 12) derivative of :meth:`Invariants.vector` by S (row by row) and b, by central differences."""
    out = np.zeros((9, 12))
    theta = np.concatenate([S.ravel(), b])
    size = np.concatenate([np.full(9, np.abs(S).max()), np.full(3, max(float(np.abs(b).max()), 1e-3))])
    for k in range(12):
        step = np.zeros(12)
        step[k] = STEP * size[k]
        high, low = theta + step, theta - step
        difference = invariants(high[:9].reshape(3, 3), high[9:]).vector()
        difference = difference - invariants(low[:9].reshape(3, 3), low[9:]).vector()
        out[:, k] = difference / (2.0 * step[k])
    return out


def triad_jacobian(S_a: FloatArray, S_g: FloatArray) -> FloatArray:
    """(3, 24) change of the triad rotation, as a rotation vector on its left, by both sensors' S and b."""
    out = np.zeros((3, 24))
    zero = np.zeros(3)
    here = triad_rotation(invariants(S_a, zero), invariants(S_g, zero))
    for sensor, (S, first) in enumerate(((S_a, 0), (S_g, 12))):
        for k in range(9):
            step = np.zeros(9)
            step[k] = STEP * np.abs(S).max()
            ends = []
            for sign in (1.0, -1.0):
                moved = S + sign * step.reshape(3, 3)
                pair = (moved, S_g) if sensor == 0 else (S_a, moved)
                there = triad_rotation(invariants(pair[0], zero), invariants(pair[1], zero))
                ends.append(rotation_vector(there @ here.T))
            out[:, first + k] = (ends[0] - ends[1]) / (2.0 * step[k])
    return out
