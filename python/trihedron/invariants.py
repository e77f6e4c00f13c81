"""Parameters of a calibration that do not depend on the choice of its frame (docs/diagnosis-method.md, section 9).

Each session has its own lower-triangular frame, so that ``S_r S_m⁻¹`` mixes parameters: a pure change of scale shows in
the off-diagonals. In the distort direction ``M = S⁻¹`` rows are ``k_i n_i``: sensitivity k of axis i and its unit
vector n. Scales, biases along each axis and angles between axes are then the same in every frame.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.transforms import rotation_by

PAIRS = ((0, 1), (0, 2), (1, 2))
STEP = 1e-6
"""Relative step of the central differences: their relative error is its square, 1e-12, plus 1e-10 by rounding."""


@dataclass(frozen=True, eq=False)
class Invariants:
    """``bias`` (3,) [SI] along each axis, ``log_scale`` (3,) ln of raw units per SI, ``angle`` (3,) [rad] between axes
    X and Y, X and Z, Y and Z, ``axes`` (3, 3) rows n_i in the model's own frame."""

    bias: FloatArray
    log_scale: FloatArray
    angle: FloatArray
    axes: FloatArray

    def vector(self) -> FloatArray:
        """(9,) bias, log_scale, angle."""
        return np.concatenate([self.bias, self.log_scale, self.angle])


def invariants(S: FloatArray, b: FloatArray) -> Invariants:
    """Equation 9.1: ``M = S⁻¹``, ``k_i = |M_i|``, ``n_i = M_i/k_i``, ``bias_i = -(M b)_i/k_i``."""
    M = np.linalg.inv(S)
    k = np.linalg.norm(M, axis=1)
    n = M / k[:, None]
    angle = np.array([np.arccos(np.clip(n[i] @ n[j], -1.0, 1.0)) for i, j in PAIRS])
    return Invariants(-(M @ b) / k, np.log(k), angle, n)


def polar_rotation(axes: FloatArray) -> FloatArray:
    """(3, 3) the orthogonal matrix nearest to a triad of unit rows or columns."""
    u, _, vt = np.linalg.svd(axes)
    out: FloatArray = u @ vt
    return out


def triad_rotation(accel: Invariants, gyro: Invariants) -> FloatArray:
    """(3, 3) ``U_g U_aᵀ``: rotation between gyro and accelerometer triad, the same in every frame."""
    return polar_rotation(gyro.axes) @ polar_rotation(accel.axes).T


def rotation_vector(R: FloatArray) -> FloatArray:
    """(3,) logarithm of a rotation, |angle| < π; of a reflection that of its negative, so that it stays finite."""
    R = R * np.sign(np.linalg.det(R))
    cosine = np.clip(0.5 * (np.trace(R) - 1.0), -1.0, 1.0)
    angle = float(np.arccos(cosine))
    skew = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    if angle < 1e-6:
        return skew
    sine = float(np.sin(angle))
    return skew * (angle / sine if sine > 1e-9 else 1.0)


def jacobian(S: FloatArray, b: FloatArray) -> FloatArray:
    """(9, 12) derivative of :meth:`Invariants.vector` by S (row by row) and b, by central differences."""
    size = np.concatenate([np.full(9, np.abs(S).max()), np.full(3, max(float(np.abs(b).max()), 1e-3))])
    return _derivative(
        lambda at: invariants(at[:9].reshape(3, 3), at[9:]).vector(), np.concatenate([S.ravel(), b]), STEP * size
    )


def triad_jacobian(S_a: FloatArray, S_g: FloatArray) -> FloatArray:
    """(3, 24) change of the triad rotation, as a rotation vector on its left, by both sensors' S and b."""
    out = np.zeros((3, 24))
    zero = np.zeros(3)
    here = triad_rotation(invariants(S_a, zero), invariants(S_g, zero))

    def turned(S_a: FloatArray, S_g: FloatArray) -> FloatArray:
        return rotation_vector(triad_rotation(invariants(S_a, zero), invariants(S_g, zero)) @ here.T)

    def size(S: FloatArray) -> FloatArray:
        return np.full(9, STEP * np.abs(S).max())

    out[:, :9] = _derivative(lambda at: turned(at.reshape(3, 3), S_g), S_a.ravel(), size(S_a))
    out[:, 12:21] = _derivative(lambda at: turned(S_a, at.reshape(3, 3)), S_g.ravel(), size(S_g))
    return out


def _derivative(of: Callable[[FloatArray], FloatArray], at: FloatArray, step: FloatArray) -> FloatArray:
    """(m, n) derivative of a function (m,) at a point (n,), by central differences."""
    steps = np.diag(step)
    return np.column_stack([(of(at + one) - of(at - one)) / (2.0 * h) for one, h in zip(steps, step, strict=True)])


@dataclass(frozen=True, eq=False)
class Anchor:
    """What the parameters do not determine: ``signs`` (3,) of the accelerometer's axes in frame lower, and ``triad``
    (3, 3), the signed permutation nearest to the rotation between the triads, from which that rotation is measured.
    """

    signs: FloatArray
    triad: FloatArray | None


def anchor_of(S_a: FloatArray, S_g: FloatArray | None) -> Anchor:
    """The anchor of a session whose accelerometer is in frame ``lower``."""
    zero = np.zeros(3)
    accel = invariants(S_a, zero)
    signs = np.sign(np.diag(accel.axes))
    if S_g is None:
        return Anchor(signs, None)
    triad = triad_rotation(accel, invariants(S_g, zero))
    chosen = max(permutations(range(3)), key=lambda order: sum(abs(triad[i, k]) for i, k in enumerate(order)))
    nearest = np.zeros((3, 3))
    for i, k in enumerate(chosen):
        nearest[i, k] = np.sign(triad[i, k])
    return Anchor(signs, nearest)


def numbers_of(
    S_a: FloatArray, b_a: FloatArray, S_g: FloatArray | None, b_g: FloatArray | None, anchor: Anchor
) -> FloatArray:
    """(9,) or (21,) parameters: bias, log_scale, angle of the accelerometer, of the gyro, and the rotation vector
    of its triad from the anchor's (eq. 9.1)."""
    accel = invariants(S_a, b_a)
    if S_g is None or b_g is None or anchor.triad is None:
        return accel.vector()
    gyro = invariants(S_g, b_g)
    turned = rotation_vector(triad_rotation(accel, gyro) @ anchor.triad.T)
    return np.concatenate([accel.vector(), gyro.vector(), turned])


def numbers_jacobian(S_a: FloatArray, b_a: FloatArray, S_g: FloatArray | None, b_g: FloatArray | None) -> FloatArray:
    """(9, 12) or (21, 24) derivative of :func:`numbers_of` near its anchor."""
    if S_g is None or b_g is None:
        return jacobian(S_a, b_a)
    out = np.zeros((21, 24))
    out[:9, :12], out[9:18, 12:] = jacobian(S_a, b_a), jacobian(S_g, b_g)
    out[18:] = triad_jacobian(S_a, S_g)
    return out


def model_of_numbers(
    numbers: FloatArray, anchor: Anchor
) -> tuple[FloatArray, FloatArray, FloatArray | None, FloatArray | None]:
    """``(S_a, b_a, S_g, b_g)`` in frame ``lower``: the inverse of :func:`numbers_of`.

    ``S = (K N)⁻¹``, ``b = -S (k ∘ bias)``. Rows of N_a follow from the angles, n_1 along X and n_2 in the plane of
    X and Y; ``N_g = √(Gram of its angles) · R · U_a``.
    """
    N_a = _lower_axes(numbers[6:9], anchor.signs)
    S_a, b_a = _direct(numbers[:3], numbers[3:6], N_a)
    if len(numbers) < 21 or anchor.triad is None:
        return np.tril(S_a), b_a, None, None
    R = rotation_by(numbers[18:21]) @ anchor.triad
    values, vectors = np.linalg.eigh(_gram(numbers[15:18]))
    N_g = vectors @ np.diag(np.sqrt(values)) @ vectors.T @ R @ polar_rotation(N_a)
    return np.tril(S_a), b_a, *_direct(numbers[9:12], numbers[12:15], N_g)


def model_vector(numbers: FloatArray, anchor: Anchor) -> FloatArray:
    """(12,) or (24,) parameters in the order of a calibration file: S row by row, then b, accelerometer first."""
    S_a, b_a, S_g, b_g = model_of_numbers(numbers, anchor)
    parts = [S_a.ravel(), b_a]
    if S_g is not None and b_g is not None:
        parts += [S_g.ravel(), b_g]
    return np.concatenate(parts)


def model_jacobian(numbers: FloatArray, anchor: Anchor) -> FloatArray:
    """(12, 9) or (24, 21) derivative of :func:`model_vector`, by central differences."""
    return _derivative(lambda at: model_vector(at, anchor), numbers, STEP * np.maximum(np.abs(numbers), 1.0))


def _direct(bias: FloatArray, log_scale: FloatArray, axes: FloatArray) -> tuple[FloatArray, FloatArray]:
    k = np.exp(log_scale)
    S = np.asarray(np.linalg.inv(k[:, None] * axes), dtype=np.float64)
    b: FloatArray = -S @ (k * bias)
    return S, b


def _gram(angle: FloatArray) -> FloatArray:
    gram = np.eye(3)
    for (i, j), value in zip(PAIRS, np.cos(angle), strict=True):
        gram[i, j] = gram[j, i] = value
    return gram


def _lower_axes(angle: FloatArray, signs: FloatArray) -> FloatArray:
    """(3, 3) unit rows, lower triangular with the given signs on the diagonal, at the given angles."""
    factor = np.linalg.cholesky(_gram(angle))
    # Cholesky's diagonal is positive: columns with a negative sign are reversed.
    return factor * signs
