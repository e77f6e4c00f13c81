r"""The linear sensor model in both directions, and its body frames (docs/model.md, section 1).

Direct form, raw → truth (*correct*):  ``f = S a' + b``.
Inverse form, truth → raw (*distort*):  ``a' = S_a f + b_a`` with ``S_a = S⁻¹``, ``b_a = -S⁻¹ b``.

Signs and handedness
--------------------
``|f| = |g|`` is unchanged by a reflection of the body frame, so that poses do not determine the sign of a row of ``S``.
Frames are therefore related by *proper rotations* only: a triad whose documented axes are left-handed (``det S < 0``)
stays left-handed in every frame, with the signs on the diagonal of ``S``, and is reported, not corrected.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.invariants import polar_rotation
from trihedron.records.calibration import Calibration, Frame, SensorCalibration
from trihedron.transforms import cross_matrix


def correct(readings: FloatArray, S: FloatArray, b: FloatArray) -> FloatArray:
    """Raw readings (n, 3) → truth (n, 3) in SI, ``S a' + b`` (eq. 1)."""
    return np.asarray(np.asarray(readings, dtype=np.float64) @ S.T + b, dtype=np.float64)


def other_form(S: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Direct form → inverse form, or back: ``(S⁻¹, -S⁻¹ b)`` (eq. 3). Raises ``InputError`` when S is singular."""
    S = np.asarray(S, dtype=np.float64)
    if np.linalg.cond(S) > 1e12:
        raise InputError("S is singular: two sensor axes are parallel, or one has no scale")
    inverse = np.asarray(np.linalg.inv(S), dtype=np.float64)
    return inverse, -inverse @ b


def axis_scales(S: FloatArray) -> FloatArray:
    """(3,) SI per raw unit of each sensor axis: truth along it over the change of its reading."""
    return np.asarray(1.0 / np.linalg.norm(np.linalg.inv(S), axis=1), dtype=np.float64)


SQUARE_RAD = np.radians(15.0)
"""Angle up to which a triad is along another's axes in some order: parts on a board are square to some degrees."""


def order_and_reversed(S: FloatArray) -> tuple[list[int], list[int]] | None:
    """The body axis of each sensor axis, and the sensor axes against theirs; ``None`` where the triad is turned
    against the body's axes by more than ``SQUARE_RAD`` from every order of them."""
    axes = orientation(S)
    order = np.argmax(np.abs(axes), axis=0)
    nearest = axes[order, range(3)]
    # The trace of the rotation left between both; of a reflection it is at most 1.
    if len(set(order.tolist())) < 3 or np.abs(nearest).sum() < 1.0 + 2.0 * np.cos(SQUARE_RAD):
        return None
    return order.tolist(), np.flatnonzero(nearest < 0.0).tolist()


def orientation(S: FloatArray) -> FloatArray:
    """(3, 3) the orthonormal matrix nearest to the directions of the columns of S: a rotation, or a reflection."""
    return polar_rotation(S / np.linalg.norm(S, axis=0))


def other_form_jacobian(S: FloatArray, b: FloatArray) -> FloatArray:
    """(12, 12) derivative of :func:`other_form`: rows and columns are S row by row, then b.

    ``δS_a = -S_a δS S_a``,  ``δb_a = -S_a δb + S_a δS S_a b``.
    """
    inverse, offset = other_form(S, b)
    jacobian = np.zeros((12, 12))
    jacobian[:9, :9] = -np.kron(inverse, inverse.T)
    jacobian[9:, :9] = -np.kron(inverse, offset[None, :])
    jacobian[9:, 9:] = -inverse
    return jacobian


def norms(readings: FloatArray, S: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``|S a' + b|`` (n,) of readings (n, 3), and its derivative (n, 12) by S row by row, then b: ``(u ⊗ a', u)``."""
    truth = correct(readings, S, b)
    norm = np.linalg.norm(truth, axis=1)
    up = truth / norm[:, None]
    return norm, np.concatenate([(up[:, :, None] * readings[:, None, :]).reshape(-1, 9), up], axis=1)


@dataclass(frozen=True, eq=False)
class Reframing:
    """Change of a triad's frame: ``S → R S``, ``b → R b`` with a proper rotation that depends on S itself.

    ``rotation`` R (3, 3); ``tilt`` (3, 12) the small rotation vector of R per change of the 12 parameters (so that
    ``δR = [tilt δp]× R``); ``jacobian`` (12, 12) of the new parameters with respect to the old ones.
    """

    rotation: FloatArray
    tilt: FloatArray
    jacobian: FloatArray

    def follow(self, S: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of another sensor's ``R S``, ``R b`` (12, 12): by its own and by this triad's parameters."""
        # The place of each parameter, S row by row and b, in the stacked columns of S and b.
        order = [*(3 * j + i for i in range(3) for j in range(3)), 9, 10, 11]
        own = np.asarray(np.kron(np.eye(4), self.rotation)[np.ix_(order, order)], dtype=np.float64)
        moved = np.column_stack([self.rotation @ S, self.rotation @ b])
        through = np.zeros((12, 12))
        for k in range(12):
            turned = cross_matrix(self.tilt[:, k]) @ moved
            through[:, k] = np.concatenate([turned[:, :3].ravel(), turned[:, 3]])
        return own, through


def reframing(S: FloatArray, b: FloatArray, frame: Frame) -> Reframing:
    """The rotation that expresses an accelerometer triad in a frame, with its derivatives (eq. 4 and 5).

    ``lower``: ``S = Q L`` with L lower triangular, ``R = Qᵀ``. ``symmetric``: ``S = U P`` (polar), ``R = Uᵀ``.
    ``case``: the identity. Where ``det S < 0`` the sign stays on the diagonal: R is the proper rotation nearest to the
    identity.

    Raises ``InputError`` when S is singular.
    """
    S = np.asarray(S, dtype=np.float64)
    b = np.asarray(b, dtype=np.float64)
    other_form(S, b)
    if frame == "case":
        return Reframing(np.eye(3), np.zeros((3, 12)), np.eye(12))
    if frame == "lower":
        # QL is QR with rows and columns reversed.
        q, _ = np.linalg.qr(S[::-1, ::-1])
        q = q[::-1, ::-1]
        q = q * np.sign(np.diag(q.T @ S))
    elif frame == "symmetric":
        u, _, vt = np.linalg.svd(S)
        q = u @ vt
    else:
        raise InputError(f"frame must be 'lower', 'symmetric' or 'case', got {frame!r}")
    signs = _nearest_proper(q)
    rotation: FloatArray = (q * signs).T
    new = rotation @ S
    tilt = np.zeros((3, 12))
    for k in range(9):
        change = np.zeros((3, 3))
        change[k // 3, k % 3] = 1.0
        turned = rotation @ change
        tilt[:, k] = _lower_tilt(turned, new) if frame == "lower" else _symmetric_tilt(turned * signs, new * signs)
    own, through = Reframing(rotation, tilt, np.eye(12)).follow(S, b)
    return Reframing(rotation, tilt, own + through)


def _lower_tilt(turned: FloatArray, new: FloatArray) -> FloatArray:
    """ω with ``turned + [ω]× new`` lower triangular."""
    x = turned @ np.linalg.inv(new)
    return np.array([x[1, 2], -x[0, 2], x[0, 1]])


def _symmetric_tilt(turned: FloatArray, new: FloatArray) -> FloatArray:
    """ω with ``turned + [ω]× new`` symmetric, new being symmetric: ``(tr(P) I - P) ω = -vee(turned - turnedᵀ)``."""
    skewness = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    return -np.linalg.solve(np.trace(new) * np.eye(3) - new, skewness)


def _nearest_proper(q: FloatArray) -> FloatArray:
    """Signs (3,) of q's columns that make it a proper rotation with the largest trace."""
    wanted = np.sign(np.linalg.det(q))
    choices = [np.array(signs) for signs in product((1.0, -1.0), repeat=3) if np.prod(signs) == wanted]
    return max(choices, key=lambda signs: float(np.sum(np.diag(q) * signs)))


def in_frame(calibration: Calibration, frame: Frame) -> Calibration:
    """Both sensors in another frame; the uncertainty of the accelerometer's axes also rotates the gyro's (eq. 6).

    Raises ``InputError`` when the accelerometer's S is singular, or ``frame`` is ``case``, which poses do not
    determine.
    """
    if frame == calibration.frame:
        return calibration
    if frame == "case":
        raise InputError("the case frame is only known from method 1 (six faces of the case)")
    change = reframing(calibration.accelerometer.S, calibration.accelerometer.b, frame)
    out = _reframed(calibration, change, frame)
    accelerometer = out.accelerometer
    return replace(out, accelerometer=replace(accelerometer, S=_exactly_in_frame(accelerometer.S, frame)))


def turned(calibration: Calibration, rotation: FloatArray) -> Calibration:
    """Both sensors in the frame of a case, to which a ``rotation`` (3, 3) leads that is none of S."""
    fixed = Reframing(rotation, np.zeros((3, 12)), np.eye(12))
    own, _ = fixed.follow(calibration.accelerometer.S, calibration.accelerometer.b)
    return _reframed(calibration, replace(fixed, jacobian=own), "case")


def _reframed(calibration: Calibration, change: Reframing, frame: Frame) -> Calibration:
    n = len(calibration.covariance)
    jacobian = np.zeros((n, n))
    jacobian[:12, :12] = change.jacobian
    if frame == "lower":
        jacobian[[1, 2, 5]] = 0.0  # entries of S that the frame fixes at 0: anything else is rounding
    accelerometer, gyroscope = calibration.accelerometer, calibration.gyroscope
    if gyroscope is not None:
        jacobian[12:, 12:], jacobian[12:, :12] = change.follow(gyroscope.S, gyroscope.b)
    covariance = jacobian @ calibration.covariance @ jacobian.T

    def moved(sensor: SensorCalibration, at: int) -> SensorCalibration:
        S, b = change.rotation @ sensor.S, change.rotation @ sensor.b
        return replace(sensor, S=S, b=b, covariance=covariance[at : at + 12, at : at + 12])

    return replace(
        calibration,
        accelerometer=moved(accelerometer, 0),
        gyroscope=None if gyroscope is None else moved(gyroscope, 12),
        covariance=covariance,
        frame=frame,
    )


def _exactly_in_frame(S: FloatArray, frame: Frame) -> FloatArray:
    """S with the entries that the frame makes 0 or equal set exactly so."""
    if frame == "lower":
        return np.tril(S)
    signs = np.sign(np.diag(S))
    return 0.5 * (S * signs + (S * signs).T) * signs
