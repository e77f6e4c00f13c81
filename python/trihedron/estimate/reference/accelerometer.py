"""An accelerometer fitted to reference motion: S and b, lever arm, and the direction of up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import AXES, TINY, FloatArray
from trihedron.errors import InputError
from trihedron.estimate.reference.clocks import Alignment
from trihedron.estimate.reference.coloured import Solution, solve
from trihedron.estimate.reference.together import Grid, Reference, Windows
from trihedron.records.reference import Estimate
from trihedron.sensor_model import other_form, other_form_jacobian
from trihedron.transforms import cross_matrix

KNOWN = 0.05
"""Largest relative σ of S with which the fitted force is used: the relative error of g-sensitivity is the same."""
CLOCK_STEP_S = 1e-3
TURNS = 4
"""Iterations of the direction of gravity: from an error of one or two degrees each squares it."""


@dataclass(frozen=True, eq=False)
class ForceFit:
    """``f_reference = S a' + b``: the ``values`` (n,) of S row by row, b, and where present up and arm.

    ``up`` is the unit vector of the static specific force in the reference's world, ``arm`` [m] leads from the
    reference's origin to the accelerometer, in the reference's body.

    The ``covariance`` (n, n) assumes exact attitudes and clock. ``wrt_attitude``, twice (n, k, 3) [1/rad], and
    ``wrt_clock`` (n, k) [1/s] are the errors of the values per attitude error about the axes of the world and of the
    body (``None``: the fit uses no attitude) and per clock error in each of k windows.
    """

    values: FloatArray
    covariance: FloatArray
    has_up: bool
    has_arm: bool
    solution: Solution
    wrt_attitude: tuple[FloatArray, FloatArray] | None
    wrt_clock: FloatArray

    @property
    def S(self) -> FloatArray:
        """(3, 3)."""
        return self.values[:9].reshape(3, 3)

    @property
    def b(self) -> FloatArray:
        """(3,)."""
        return self.values[9:12]

    @property
    def up(self) -> Estimate | None:
        """Up in the reference's world."""
        return Estimate(AXES, self.values[12:15], self.covariance[12:15, 12:15], "1") if self.has_up else None

    @property
    def arm(self) -> Estimate | None:
        """The lever arm."""
        return Estimate(AXES, self.values[-3:], self.covariance[-3:, -3:], "m") if self.has_arm else None


def fit_accelerometer(
    grid: Grid, reference: Reference, windows: Windows, clock: Alignment, gravity: float, handedness: float
) -> ForceFit | None:
    """Fit by windows; ``None`` where the reference has no force. ``handedness`` is the sign of the gyro's det A.

    With attitude alone the acceleration of the body is unknown: the second derivative of a bounded path has little
    power at the low frequencies of gravity's rotation, and the spectrum of the residuals shows how much. Raises
    ``InputError`` when there are too few windows, or the reference's frames are mirrored.
    """
    motion = reference.motion
    if grid.accelerometer is None or (motion.attitude is None and motion.specific_force is None):
        return None
    time = grid.time_s * (1.0 + clock.rate) + clock.offset_s
    if motion.position is None and motion.specific_force is None:
        return _under_gravity(grid.accelerometer, reference, windows, time, gravity, handedness)
    found = _along_path(grid.accelerometer, reference, windows, time, gravity)
    if float(np.linalg.det(found.S)) * handedness < 0.0:
        raise InputError(
            f"{motion.source}: the reference is mirrored against the log: its turns and its forces are those "
            "of frames of opposite handedness. Turn the sign of one axis of the reference (position and attitude), or "
            "of one sensor's axis in the log."
        )
    return found


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


def _along_path(
    accelerometer: FloatArray, reference: Reference, windows: Windows, time: FloatArray, gravity: float
) -> ForceFit:
    """Fit to attitude and position: ``C (S a' + b) = d²(p + C ℓ)/dt² + g u`` in the reference's world.

    Of another unit the specific force f is known instead of the path: ``C f = d²p/dt² + g u``.
    """
    k, motion = len(windows.start), reference.motion
    has_up = motion.position is not None
    # Two units average alike.
    averaged = _averaged(accelerometer) if has_up else np.zeros_like(accelerometer)
    signals = np.column_stack([accelerometer - 0.5 * averaged, np.ones(len(time))])

    def rows(at: FloatArray) -> tuple[FloatArray, FloatArray]:
        C = reference.attitude(at)
        moments = windows.of(windows.weight, C[:, :, :, None] * signals[:, None, None, :])
        columns = moments[:, :, :, :3].reshape(k, 3, 9), moments[:, :, :, 3], -windows.of(windows.curvature, C)
        base = np.concatenate(columns, axis=2)
        if has_up:
            return base, windows.of(windows.curvature, reference.position(at))
        # The noise of two units is that of their axes.
        back = np.swapaxes(C[windows.middle], 1, 2)
        moved = windows.of(windows.weight, np.einsum("nij,nj->ni", C, reference.specific_force(at)))
        return back @ base, np.einsum("kij,kj->ki", back, moved)

    base, path = rows(time)
    up = _first_up(base, path, gravity) if has_up else np.zeros(3)
    size = _turning(windows, reference, time)
    for _ in range(TURNS):
        across = _across(up) if has_up else np.zeros((3, 0))
        design = np.concatenate([base, np.broadcast_to(-gravity * across, (k, 3, across.shape[1]))], axis=2)
        solution = solve(design, path + gravity * up, windows.start // windows.spacing, size)
        up = up + across @ solution.theta[15:]
        up /= max(float(np.linalg.norm(up)), TINY)
    own = solution.theta[:15]
    # Elements S and b, up, arm from those of the solution: S and b, arm, up across its direction.
    J = np.zeros((15 + 3 * has_up, len(solution.theta)))
    J[:12, :12], J[-3:, 12:15] = np.eye(12), np.eye(3)
    J[12:15, 15:] += across if has_up else 0.0
    influence = np.einsum("ij,jka->ika", J, solution.influence)

    def left(at: FloatArray) -> FloatArray:
        base, path = rows(at)
        return path - base @ own

    C, S = reference.attitude(time), own[:9].reshape(3, 3)
    turned = np.einsum("nij,nj->ni", C, averaged @ S.T)
    by_average = np.einsum("nka,ka->n", influence, windows.of(windows.weight, turned)) / np.sqrt(12.0)
    wrt_attitude = None
    if has_up:
        # An attitude error -ε of the world changes the prediction (C S a' + ...) by -ε x itself; one of the body turns
        # force and lever arm before they are differentiated.
        force = C @ cross_matrix(signals[:, :3] @ S.T + own[9:12])
        by_body = windows.of(windows.weight, force) + base[:, :, 12:15] @ cross_matrix(own[None, 12:])
        wrt_attitude = _wrt_attitude(influence, cross_matrix(base @ own), by_body)
    return ForceFit(
        np.concatenate([own[:12], up if has_up else np.zeros(0), own[12:]]),
        J @ solution.covariance @ J.T + np.outer(by_average, by_average),
        has_up, True, solution, wrt_attitude, _wrt_clock(influence, left, time),
    )  # fmt: skip


def _averaged(readings: FloatArray) -> FloatArray:
    """(n, 3) difference of averages over a sample interval from instantaneous values: T²/24 of the second derivative.

    Some parts average and others do not: readings are corrected by half, and the rest is an uncertainty (uniform).
    """
    padded = np.pad(readings, ((1, 1), (0, 0)), mode="edge")
    return np.asarray((padded[2:] - 2.0 * readings + padded[:-2]) / 24.0)


def _wrt_attitude(influence: FloatArray, world: FloatArray, body: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Errors (n, k, 3) of the parameters per attitude error, from their ``influence`` (n, k, 3) and the derivatives
    (k, 3, 3) of the rows by errors of world and body."""
    return np.einsum("nka,kab->nkb", influence, world), np.einsum("nka,kab->nkb", influence, body)


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
    readings: FloatArray, reference: Reference, windows: Windows, time: FloatArray, gravity: float, handedness: float
) -> ForceFit:
    """Fit to attitude alone: ``a' = M Cᵀ g u + c``; the unknown acceleration of the body is noise.

    The readings are the dependent variable: with their noise in the regressors M would be too small.
    """
    target = windows.of(windows.weight, readings)

    def turned_back(at: FloatArray) -> FloatArray:
        return gravity * np.swapaxes(windows.of(windows.weight, reference.attitude(at)), 1, 2)

    back = turned_back(time)
    k = len(windows.start)
    up, M = _gravity_seen(target, back, handedness)
    design = np.zeros((k, 3, 14))
    size = _turning(windows, reference, time)
    for _ in range(TURNS):
        across = _across(up)
        seen = back @ up
        for i in range(3):
            design[:, i, 3 * i : 3 * i + 3] = seen
            design[:, i, 9 + i] = 1.0
        design[:, :, 12:] = M @ back @ across
        solution = solve(design, target, windows.start // windows.spacing, size)
        M = solution.theta[:9].reshape(3, 3)
        up = up + across @ solution.theta[12:]
        up /= np.linalg.norm(up)
        # The change of u is linearised with M and now part of u.
    S, b = other_form(M, solution.theta[9:12])
    J = np.zeros((15, 14))
    J[:12, :12], J[12:, 12:] = other_form_jacobian(M, solution.theta[9:12]), across
    influence = np.einsum("ij,jka->ika", J, solution.influence)
    scale = float(np.mean(np.linalg.svd(S, compute_uv=False)))
    in_si = replace(solution, residual=solution.residual * scale, rms_held_out=solution.rms_held_out * scale)

    def left(at: FloatArray) -> FloatArray:
        return -turned_back(at) @ up @ M.T

    return ForceFit(
        np.concatenate([S.ravel(), b, up]), J @ solution.covariance @ J.T, True, False, in_si,
        _wrt_attitude(influence, -M @ back @ cross_matrix(up[None]), -M @ cross_matrix(back @ up)),
        _wrt_clock(influence, left, time),
    )  # fmt: skip


def _gravity_seen(readings: FloatArray, back: FloatArray, handedness: float) -> tuple[FloatArray, FloatArray]:
    """Initial u and M: the best of starts from each axis of the world and from a rank-one fit to the readings.

    Each reading is a linear form of Cᵀ of rank one in (M, u), which determines both only with sufficient tilt.
    """
    k = len(readings)

    def fitted(u: FloatArray) -> tuple[FloatArray, FloatArray]:
        seen = np.column_stack([back @ u, np.ones(k)])
        both = np.linalg.lstsq(seen, readings, rcond=None)[0]
        return np.asarray(both[:3].T), np.asarray(readings - seen @ both)

    K = np.linalg.lstsq(np.column_stack([back.reshape(k, 9), np.ones(k)]), readings, rcond=None)[0][:9].T
    tried = []
    for u in (np.linalg.svd(K.reshape(9, 3), full_matrices=False)[2][0], *np.eye(3)):
        for _ in range(TURNS):
            M, rest = fitted(u)
            across = _across(u)
            u = u + across @ np.linalg.lstsq((M @ back @ across).reshape(3 * k, 2), rest.ravel(), rcond=None)[0]
            u /= np.linalg.norm(u)
        tried.append(u)
    u = min(tried, key=lambda one: float(np.median(np.linalg.norm(fitted(one)[1], axis=1))))
    M = fitted(u)[0]
    # The norm of gravity does not distinguish up from down; the handedness of the gyro's axes does.
    sign = 1.0 if np.linalg.det(M) * handedness > 0.0 else -1.0
    return sign * u, sign * M


def _across(up: FloatArray) -> FloatArray:
    """(3, 2) orthonormal vectors perpendicular to ``up`` (3,)."""
    return np.asarray(np.linalg.svd(up[None, :])[2][1:].T, dtype=np.float64)
