"""An accelerometer fitted to reference motion: S and b, lever arm, and the direction of up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.errors import InputError
from trihedron.estimate.reference.coloured import Solution, solve
from trihedron.estimate.reference.together import Grid, Reference, Windows
from trihedron.sensor_model import other_form, other_form_jacobian
from trihedron.transforms import cross_matrix

KNOWN = 0.05
"""Largest relative σ of S with which the fitted force is used: the relative error of g-sensitivity is the same."""
CLOCK_STEP_S = 1e-3
TURNS = 4
"""Iterations of the direction of gravity: from an error of one or two degrees each squares it."""


@dataclass(frozen=True, eq=False)
class ForceFit:
    """``f_reference = S a' + b`` with ``covariance`` (12, 12).

    ``up`` (3,): unit vector of the static specific force in the reference's world, with its covariance (3, 3); ``arm``
    (3,) [m] from the reference's origin to the accelerometer, in the reference's body.

    The covariances assume exact attitudes and clock. ``wrt_attitude`` (n, k, 3) [1/rad] and ``wrt_clock`` (n, k) [1/s]
    are the errors of the n elements of S, b, up and arm (where present) per attitude error about a world axis
    (``None``: the fit uses no attitude) and per clock error in each of k windows.
    """

    S: FloatArray
    b: FloatArray
    covariance: FloatArray
    up: FloatArray | None
    up_covariance: FloatArray | None
    arm: FloatArray | None
    arm_covariance: FloatArray | None
    solution: Solution
    wrt_attitude: FloatArray | None
    wrt_clock: FloatArray

    def with_error(self, covariance: FloatArray) -> ForceFit:
        """The fit with the covariance (n, n) of its n elements by errors of attitudes and clock added."""
        up, arm = self.up_covariance, self.arm_covariance
        n = 12 if up is None else 15
        return replace(
            self,
            covariance=self.covariance + covariance[:12, :12],
            up_covariance=None if up is None else up + covariance[12:15, 12:15],
            arm_covariance=None if arm is None else arm + covariance[n:, n:],
        )


def turns(columns: FloatArray) -> FloatArray:
    """(3 n, 3) derivative of vectors (3, n), row by row, by small rotations of their frame [1/rad]."""
    return np.stack([np.cross(axis, columns.T).T.ravel() for axis in np.eye(3)], axis=1)


def turns_of_frame(S: FloatArray, b: FloatArray) -> FloatArray:
    """(12, 3) derivative of (S row by row, b) by small rotations of the frame of S a' + b [1/rad]."""
    return np.vstack([turns(S), turns(b[:, None])])


def fit_accelerometer(
    grid: Grid, reference: Reference, windows: Windows, offset_s: float, rate: float, gravity: float, handedness: float
) -> ForceFit | None:
    """Fit by windows; ``None`` where the reference has no force. ``handedness`` is the sign of the gyro's det A.

    With attitude alone the acceleration of the body is unknown: the second derivative of a bounded path has little
    power at the low frequencies of gravity's rotation, and the spectrum of the residuals shows how much. Raises
    ``InputError`` when there are too few windows, or the reference's frames are mirrored.
    """
    if grid.accelerometer is None:
        return None
    time = grid.time_s * (1.0 + rate) + offset_s
    motion = reference.motion
    if motion.attitude is not None and motion.position is not None:
        return _along_path(grid, reference, windows, time, gravity, handedness)
    if motion.attitude is not None:
        return _under_gravity(grid, reference, windows, time, gravity, handedness)
    if motion.specific_force is not None:
        return _in_body(grid, reference, windows, time, handedness)
    return None


def force_along(grid: Grid, force: ForceFit, gyro: FloatArray, gravity: float) -> FloatArray | None:
    """(n, 3) [m/s²] specific force in the reference's body, for the gyro's g-sensitivity.

    A multicopter leans into its acceleration, and an attitude alone does not determine its accelerometer's parameters:
    the axes are then taken as those of a gyro of scale ``gyro`` (3, 3), and the median norm as gravity.
    """
    if grid.accelerometer is None:
        return None
    scale = np.linalg.norm(force.S, axis=0)
    sigma = np.sqrt(np.diag(force.covariance)[:9]).reshape(3, 3)
    if np.all(sigma < KNOWN * scale):
        return np.asarray(grid.accelerometer @ force.S.T + force.b)
    U, _, Vt = np.linalg.svd(gyro)
    size = np.median(np.linalg.norm(grid.accelerometer[grid.is_valid], axis=1))
    return np.asarray(gravity / size * grid.accelerometer @ (U @ Vt).T)


def _in_body(grid: Grid, reference: Reference, windows: Windows, time: FloatArray, handedness: float) -> ForceFit:
    """Fit to another unit: ``S a' + b = f + dω/dt x ℓ + ω x (ω x ℓ)``, all in the other's body."""
    assert grid.accelerometer is not None
    signals = windows.of(windows.weight, np.column_stack([grid.accelerometer, np.ones(len(time))]))
    k = len(windows.start)
    readings = np.zeros((k, 3, 12))
    for i in range(3):
        readings[:, i, 3 * i : 3 * i + 3] = signals[:, :3]
        readings[:, i, 9 + i] = signals[:, 3]

    def rows(at: FloatArray) -> tuple[FloatArray, FloatArray]:
        omega = cross_matrix(reference.rate(at))
        by_arm = windows.of(windows.slope, omega) - windows.of(windows.weight, omega @ omega)
        return np.concatenate([readings, by_arm], axis=2), windows.of(windows.weight, reference.specific_force(at))

    design, target = rows(time)
    size = _turning(windows, reference, time)
    solution = solve(design, target, windows.start // windows.spacing, size)
    S, b = solution.theta[:9].reshape(3, 3), solution.theta[9:12]
    _reject_mirror(reference, float(np.linalg.det(S)), handedness)

    def left(at: FloatArray) -> FloatArray:
        design, target = rows(at)
        return target - design @ solution.theta

    return ForceFit(
        S, b, solution.covariance[:12, :12], None, None, solution.theta[12:], solution.covariance[12:, 12:], solution,
        None, _wrt_clock(solution.influence, left, time),
    )  # fmt: skip


def _along_path(
    grid: Grid, reference: Reference, windows: Windows, time: FloatArray, gravity: float, handedness: float
) -> ForceFit:
    """Fit to attitude and position: ``C (S a' + b) = d²(p + C ℓ)/dt² + g u`` in the reference's world."""
    assert grid.accelerometer is not None
    k = len(windows.start)
    averaged = _averaged(grid.accelerometer)
    signals = np.column_stack([grid.accelerometer - 0.5 * averaged, np.ones(len(time))])

    def rows(at: FloatArray) -> tuple[FloatArray, FloatArray]:
        C = reference.attitude(at)
        moments = windows.of(windows.weight, C[:, :, :, None] * signals[:, None, None, :])
        columns = moments[:, :, :, :3].reshape(k, 3, 9), moments[:, :, :, 3], -windows.of(windows.curvature, C)
        return np.concatenate(columns, axis=2), windows.of(windows.curvature, reference.position(at))

    base, path = rows(time)
    up = _first_up(base, path, gravity)
    size, noise = _turning(windows, reference, time), None
    for _ in range(TURNS):
        across = _across(up)
        design = np.concatenate([base, np.broadcast_to(-gravity * across, (k, 3, 2))], axis=2)
        solution = solve(design, path + gravity * up, windows.start // windows.spacing, size, noise)
        noise = solution.model
        up = up + across @ solution.theta[15:]
        up /= np.linalg.norm(up)
    S, b = solution.theta[:9].reshape(3, 3), solution.theta[9:12]
    _reject_mirror(reference, float(np.linalg.det(S)), handedness)
    up_covariance = across @ solution.covariance[15:, 15:] @ across.T
    arm, arm_covariance = solution.theta[12:15], solution.covariance[12:15, 12:15]
    own = solution.theta[:15]
    by_up = np.einsum("ij,jka->ika", across, solution.influence[15:])
    influence = np.concatenate([solution.influence[:12], by_up, solution.influence[12:15]])

    def left(at: FloatArray) -> FloatArray:
        base, path = rows(at)
        return path - base @ own

    turned = np.einsum("nij,nj->ni", reference.attitude(time), averaged @ S.T)
    by_average = np.einsum("nka,ka->n", influence, windows.of(windows.weight, turned)) / np.sqrt(12.0)
    found = ForceFit(
        S, b, solution.covariance[:12, :12], up, up_covariance, arm, arm_covariance, solution,
        # An attitude error -ε changes the prediction (C S a' + ...) by -ε x itself.
        np.einsum("nka,kab->nkb", influence, cross_matrix(base @ own)), _wrt_clock(influence, left, time),
    )  # fmt: skip
    return found.with_error(np.outer(by_average, by_average))


def _averaged(readings: FloatArray) -> FloatArray:
    """(n, 3) difference of averages over a sample interval from instantaneous values: T²/24 of the second derivative.

    Some parts average and others do not: readings are corrected by half, and the rest is an uncertainty (uniform).
    """
    padded = np.pad(readings, ((1, 1), (0, 0)), mode="edge")
    return np.asarray((padded[2:] - 2.0 * readings + padded[:-2]) / 24.0)


def _wrt_clock(influence: FloatArray, left: Callable[[FloatArray], FloatArray], time: FloatArray) -> FloatArray:
    """(n, k) errors of the parameters per clock error [1/s], from their ``influence`` (n, k, 3) and the time derivative
    of the residuals ``left`` (k, 3)."""
    change = (left(time + CLOCK_STEP_S) - left(time - CLOCK_STEP_S)) / (2.0 * CLOCK_STEP_S)
    return np.asarray(-np.einsum("nka,ka->nk", influence, change))


def _turning(windows: Windows, reference: Reference, time: FloatArray) -> FloatArray:
    """(k,) magnitude of the mean rate in each window, with which noise may grow: rotation by hand also accelerates."""
    return np.asarray(np.linalg.norm(windows.of(windows.weight, reference.rate(time)), axis=1), dtype=np.float64)


def _first_up(base: FloatArray, path: FloatArray, gravity: float) -> FloatArray:
    """Initial direction of up (3,): readings rotated into the world less the acceleration of the path."""
    k, _, n = base.shape
    scale = np.sqrt(np.mean(base**2, axis=(0, 1))) + TINY
    X = np.column_stack([(base / scale).reshape(3 * k, n), np.tile(-gravity * np.eye(3), (k, 1))])
    u = np.linalg.lstsq(X, path.ravel(), rcond=None)[0][n:]
    return np.asarray(u / max(float(np.linalg.norm(u)), TINY))


def _under_gravity(
    grid: Grid, reference: Reference, windows: Windows, time: FloatArray, gravity: float, handedness: float
) -> ForceFit:
    """Fit to attitude alone: ``a' = M Cᵀ g u + c``; the unknown acceleration of the body is noise.

    The readings are the dependent variable: with their noise in the regressors M would be too small.
    """
    assert grid.accelerometer is not None
    readings = windows.of(windows.weight, grid.accelerometer)

    def turned_back(at: FloatArray) -> FloatArray:
        return gravity * np.swapaxes(windows.of(windows.weight, reference.attitude(at)), 1, 2)

    back = turned_back(time)
    k = len(windows.start)
    up, M = _gravity_seen(readings, back, handedness)
    design = np.zeros((k, 3, 14))
    size, noise = _turning(windows, reference, time), None
    for _ in range(TURNS):
        across = _across(up)
        seen = back @ up
        for i in range(3):
            design[:, i, 3 * i : 3 * i + 3] = seen
            design[:, i, 9 + i] = 1.0
        design[:, :, 12:] = M @ back @ across
        solution = solve(design, readings, windows.start // windows.spacing, size, noise)
        noise = solution.model
        M = solution.theta[:9].reshape(3, 3)
        up = up + across @ solution.theta[12:]
        up /= np.linalg.norm(up)
        # The change of u is linearised with M and now part of u.
    S, b = other_form(M, solution.theta[9:12])
    jacobian = other_form_jacobian(M, solution.theta[9:12])
    covariance = jacobian @ solution.covariance[:12, :12] @ jacobian.T
    scale = float(np.mean(np.linalg.svd(S, compute_uv=False)))
    in_si = replace(solution, residual=solution.residual * scale, rms_held_out=solution.rms_held_out * scale)
    all_of = np.zeros((15, 14))
    all_of[:12, :12], all_of[12:, 12:] = jacobian, across
    influence = np.einsum("ij,jka->ika", all_of, solution.influence)

    def left(at: FloatArray) -> FloatArray:
        return -turned_back(at) @ up @ M.T

    return ForceFit(
        S, b, covariance, up, across @ solution.covariance[12:, 12:] @ across.T, None, None, in_si,
        -np.einsum("nka,kab->nkb", influence, M @ back @ cross_matrix(up[None])), _wrt_clock(influence, left, time),
    )  # fmt: skip


def _gravity_seen(readings: FloatArray, back: FloatArray, handedness: float) -> tuple[FloatArray, FloatArray]:
    """Initial u and M: the best of starts from each axis of the world and from a rank-one fit to the readings.

    Each reading is a linear form of Cᵀ of rank one in (M, u), which determines both only with sufficient tilt.
    """
    k = len(readings)
    X = np.column_stack([back.reshape(k, 9), np.ones(k)])
    K = np.linalg.lstsq(X, readings, rcond=None)[0][:9].T.reshape(9, 3)
    best: tuple[float, FloatArray, FloatArray] | None = None
    for start in (np.linalg.svd(K, full_matrices=False)[2][0], *np.eye(3)[::-1]):
        u = np.asarray(start, dtype=np.float64)
        for _ in range(TURNS):
            seen = np.column_stack([back @ u, np.ones(k)])
            M = np.asarray(np.linalg.lstsq(seen, readings, rcond=None)[0][:3].T, dtype=np.float64)
            across = _across(u)
            slope = (M @ back @ across).reshape(3 * k, 2)
            rest = readings - seen @ np.vstack([M.T, np.mean(readings - back @ u @ M.T, axis=0)])
            u = u + across @ np.linalg.lstsq(slope, rest.ravel(), rcond=None)[0]
            u /= np.linalg.norm(u)
        misfit = float(np.median(np.linalg.norm(rest, axis=1)))
        if best is None or misfit < 0.98 * best[0]:
            best = misfit, u, M
    assert best is not None
    _, u, M = best
    # The norm of gravity does not distinguish up from down; the handedness of the gyro's axes does.
    sign = 1.0 if np.linalg.det(M) * handedness > 0.0 else -1.0
    return sign * u, sign * M


def _reject_mirror(reference: Reference, determinant: float, handedness: float) -> None:
    if determinant * handedness < 0.0:
        raise InputError(
            f"{reference.motion.source}: the reference is mirrored against the log: its turns and its forces are those "
            "of frames of opposite handedness. Turn the sign of one axis of the reference (position and attitude), or "
            "of one sensor's axis in the log."
        )


def _across(up: FloatArray) -> FloatArray:
    """(3, 2) orthonormal vectors perpendicular to ``up`` (3,)."""
    return np.asarray(np.linalg.svd(up[None, :])[2][1:].T, dtype=np.float64)
