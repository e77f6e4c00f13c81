"""Tilt errors after rotations with their noise (equation 5.1), and gravity errors in static poses.

The published figures of a calibration, in sample and held out, always use the saved S and b: the gravity error in
static poses with one bias for the session, the tilt error after each rotation with a bias per pose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import AXES, FloatArray
from trihedron.estimate.accelerometer.norm import N_PARAMETERS, gravity_quality
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.session.fit import SessionSolution
from trihedron.estimate.session.observed import Observed, left_by_earth
from trihedron.gravity import turned_with_earth
from trihedron.records import Calibration, FitQuality, Segments
from trihedron.sensor_model import in_frame, norms
from trihedron.session.model import DYNAMICS, MOVES, STATIC_ACCEL
from trihedron.transforms import directions_of

N_GYROSCOPE = 9
N_FOLDS = 5
"""Folds of the cross-validation: a fifth of the poses, then of the moves; a single one where fewer would remain."""


def norm_quality(solution: SessionSolution, held: tuple[FloatArray, FloatArray] | None) -> FitQuality:
    """Gravity errors in static poses at the saved S, b of the accelerometer; ``held`` (n,) are the held-out ones with
    their standard errors.

    Moves determine S and b too: the poses lose less than nine degrees of freedom to them.
    """
    observed, S, b = solution.observed, solution.S_a, solution.b_a
    residual, sigma = norm_errors(observed, S, b)
    of_fit = _of_model(observed, S, b, solution.covariance[:12, :12])
    lost = min(float(np.sum(np.minimum(of_fit / sigma**2, 1.0))), N_PARAMETERS)
    found = gravity_quality(residual, sigma, round(len(residual) - lost), held)
    return replace(
        found,
        n_iterations=solution.iterations,
        stopped_because=solution.stopped_because,
    )


def norm_errors(observed: Observed, S_a: FloatArray, b_a: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``|S a' + b| - |g|`` (n,) and its noise (n,), m/s²."""
    force = (observed.pose_force + observed.force_origin) @ S_a.T + b_a
    norm = np.linalg.norm(force, axis=1)
    gain = (force / norm[:, None]) @ S_a
    return norm - observed.gravity_m_s2, observed.norm_sigma(gain)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Held-out residuals: gravity error of every pose (n,) with its standard error, m/s², and tilt errors of moves."""

    norm: FloatArray
    norm_sigma: FloatArray
    moves: Carried


def held_out(measured: MoveMeasurements, anchors_s: FloatArray, solution: SessionSolution) -> HeldOut | None:
    """Cross-validation over every k-th pose, then every k-th move, or every one; ``None`` where too few would remain.

    Noise strengths, and the factors on the moves' errors, are those of the whole session; a fit without the fold is one
    linear step from the optimum (eq. 11.15).
    """
    observed = solution.observed
    n, m = len(observed.pose_force), len(observed.before)
    enough = [k for k in (N_FOLDS, m) if m - -(-m // k) > N_GYROSCOPE // 2 and n - -(-n // k) >= N_PARAMETERS]
    if not enough:
        return None
    n_folds = enough[0]
    core = solution.core
    labels = core.labels
    is_reading = labels[:, 3] == 0
    is_pose = is_reading & (labels[:, 0] == STATIC_ACCEL)
    is_move = is_reading & ((labels[:, 0] == MOVES) | (labels[:, 0] == DYNAMICS))
    is_of_fold = labels[:, 1] % n_folds == np.arange(n_folds)[:, None]
    rests = core.without(np.concatenate([is_pose & is_of_fold, is_move & is_of_fold]), observed.force_origin)
    norm, norm_sigma = np.full(n, np.nan), np.full(n, np.nan)
    for fold, (S, b_centred, _, covariance) in enumerate(rests[:n_folds]):
        holds, b = np.arange(n) % n_folds == fold, b_centred - S @ observed.force_origin
        residual, noise = norm_errors(observed, S, b)
        norm[holds] = residual[holds]
        norm_sigma[holds] = np.sqrt(noise**2 + _of_model(observed, S, b, covariance))[holds]
    number = {int(hold): k for k, hold in enumerate(measured.links[:, 0])}
    which = np.array([number[int(hold)] for hold in observed.before], dtype=np.int64)
    n_moves = len(measured.links)
    S_a, S_w = (np.repeat(S[None], n_moves, axis=0) for S in (solution.S_a, solution.S_w))
    b_a = np.repeat(solution.b_a[None], n_moves, axis=0)
    for fold, (S, b_centred, rate_scale, _) in enumerate(rests[n_folds:]):
        at = which[fold::n_folds]
        S_a[at], b_a[at], S_w[at] = S, b_centred - S @ observed.force_origin, rate_scale
    seen = carried(measured, anchors_s, S_a, b_a, S_w)
    is_fitted = np.isin(np.arange(n_moves), which)
    moves = replace(
        seen,
        residual=np.where(is_fitted[:, None], seen.residual, np.nan),
        angle_deg=np.where(is_fitted, seen.angle_deg, np.nan),
    )
    return HeldOut(norm, norm_sigma, moves)


def _of_model(observed: Observed, S: FloatArray, b: FloatArray, covariance: FloatArray) -> FloatArray:
    """(n,) variance of the norm by the uncertainty of S, b: ``J C Jᵀ`` with ``J = (u ⊗ a', u)``."""
    _, jacobian = norms(observed.pose_force + observed.force_origin, S, b)
    return np.asarray(np.maximum(np.einsum("ni,ij,nj->n", jacobian, covariance, jacobian), 0.0))


def move_quality(
    gravity_m_s2: float, seen: Carried, held: Carried | None, used: FloatArray, misfit: tuple[float, int]
) -> FitQuality:
    """The gyro's residuals in sample and held out; a tilt error has two components, and rms is per component.

    ``used`` (m,) are the weights of the moves, ``misfit`` their χ² and its degrees of freedom.
    """
    is_used = used > 0.0
    g = gravity_m_s2
    n = 2 * int(np.count_nonzero(is_used))
    dof = max(n - N_GYROSCOPE, 0)
    total = float(np.sum((g * np.radians(seen.angle_deg[is_used])) ** 2))
    variance = np.einsum("mii->mi", seen.noise)
    along = np.einsum("mi,mij,mj->m", seen.up, seen.noise, seen.up)
    held_rms = None
    if held is not None:
        known = is_used & np.isfinite(held.angle_deg)
        held_rms = float(np.sqrt(np.sum((g * np.radians(held.angle_deg[known])) ** 2) / (2 * known.sum())))
    return FitQuality(
        unit="m/s^2",
        residual=seen.residual,
        sigma=np.sqrt(variance),
        chi2=misfit[0],
        dof=misfit[1],
        rms=float(np.sqrt(total / n)),
        rms_dof=float(np.sqrt(total / dof)) if dof else float("nan"),
        floor=float(np.sqrt(np.sum((variance.sum(axis=1) - along)[is_used]) / n)),
        held_out=None if held is None else held.residual,
        held_out_sigma=None if held is None else held.sigma,
        held_out_rms=held_rms,
        angle_deg=seen.angle_deg,
        held_out_angle_deg=None if held is None else held.angle_deg,
        weights=used,
    )


@dataclass(frozen=True, eq=False)
class Carried:
    """Tilt errors after moves: ``residual`` (m, 3) m/s² with its ``covariance`` (m, 3, 3), ``angle_deg`` (m,).

    ``floor2`` (m,) is the variance across the vertical by poses, samples (bridged ones too) and the Earth's rotation,
    (m/s²)²; ``noise`` (m, 3, 3) the covariance by noise and Earth alone, without what the accelerometer leaves
    unexplained in the poses;
    ``up`` (m, 3) the unit vertical after a move, ``wrt_scale`` (m, 3, 9) and ``wrt_accelerometer`` (m, 3, 12) the
    derivatives of the residual by the gyro's S row by row, and by S and b of the accelerometer.
    """

    residual: FloatArray
    covariance: FloatArray
    angle_deg: FloatArray
    floor2: FloatArray
    noise: FloatArray
    up: FloatArray
    wrt_scale: FloatArray
    wrt_accelerometer: FloatArray

    @property
    def sigma(self) -> FloatArray:
        """(m, 3) standard errors of the residual, m/s²."""
        return np.asarray(np.sqrt(np.einsum("mii->mi", self.covariance)))

    def by_calibration2(self, covariance: FloatArray) -> FloatArray:
        """(m,) variance across the vertical by the covariance (24, 24) of a calibration, (m/s²)²."""
        derivative = np.concatenate([self.wrt_accelerometer, self.wrt_scale], axis=2)
        return _across2(self.up, derivative @ _root(covariance[:21, :21]))


def carried(
    measured: MoveMeasurements, anchors_s: FloatArray, S_a: FloatArray, b_a: FloatArray, S_w: FloatArray
) -> Carried:
    """Tilt error ``B f_i - f_j`` of every move, from the pose means at both ends, with a bias per pose.

    The one definition of the tilt error: in sample, held out, and for a calibration verified on another session.
    ``S_a``, ``S_w`` (3, 3) and ``b_a`` (3,) are those of all moves, or (m, 3, 3), (m, 3) of each.
    """
    before, after = measured.links[:, 0], measured.links[:, 1]
    m = len(before)
    S_a, S_w, b_a = np.broadcast_to(S_a, (m, 3, 3)), np.broadcast_to(S_w, (m, 3, 3)), np.broadcast_to(b_a, (m, 3))
    start, end = (np.einsum("mij,mj->mi", S_a, measured.reading[of]) + b_a for of in (before, after))
    of_before, of_after = (-np.einsum("mij,mj->mi", S_w, measured.bias[of]) for of in (before, after))
    noise = _core.RateNoise(measured.noise_density, measured.sigma_time_s, measured.nominal_step_s)
    rotation, wrt_scale, wrt_before, wrt_after, wrt_room, cov_rate = _core.integrate_moves(
        measured.time_s, measured.rate, measured.edges, anchors_s, S_w, of_before, of_after, 3,
        noise,
    )  # fmt: skip
    earth = turned_with_earth(measured.latitude_deg, directions_of(start))
    # Where in a turn the Earth, a bridge or rounding acts decides about which axis: any is as likely.
    by_readings = np.einsum("mij,mj->m", S_w**2, measured.angle_variance) / 3.0
    cov_rate += (left_by_earth(wrt_room, earth) + by_readings)[:, None, None] * np.eye(3)
    read = measured.reading[before], measured.reading[after]
    by_S = rotation[..., None] * read[0][:, None, None, :] - np.eye(3)[..., None] * read[1][:, None, None, :]
    wrt_accelerometer = np.concatenate([by_S.reshape(m, 3, 9), rotation - np.eye(3)], axis=2)
    moved = np.einsum("mij,mj->mi", rotation, start)
    residual = moved - end
    unit_moved, unit_end = directions_of(moved), directions_of(end)
    angle = np.degrees(2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(unit_moved - unit_end, axis=1), 1.0)))
    turn = rotation @ np.cross(np.eye(3), start[:, None, :])

    sigma_bias = np.sqrt(measured.var_bias)[:, None, :]
    # Roots of covariances side by side: sums of squares stay positive under rounding, unlike the differences of large
    # terms that rotations about the vertical cause.
    of_rate = [turn @ _root(cov_rate), turn @ wrt_before @ (S_w * sigma_bias[before]),
               turn @ wrt_after @ (S_w * sigma_bias[after])]  # fmt: skip

    def root_with(var_reading: FloatArray) -> FloatArray:
        sigma = np.sqrt(var_reading)[:, None, :]
        return np.concatenate([*of_rate, rotation @ (S_a * sigma[before]), S_a * sigma[after]], axis=2)

    root, of_noise = root_with(measured.var_reading), root_with(measured.var_reading_noise)
    # Raw biases z are subtracted: S enters through the rate and through -S z.
    ends = (wrt_before, measured.bias[before]), (wrt_after, measured.bias[after])
    wrt_S = wrt_scale - sum((wrt[:, :, :, None] * bias[:, None, None, :]).reshape(m, 3, 9) for wrt, bias in ends)
    covariance, by_noise = (one @ np.swapaxes(one, 1, 2) for one in (root, of_noise))
    floor2 = _across2(unit_end, root)
    return Carried(residual, covariance, angle, floor2, by_noise, unit_end, turn @ wrt_S, wrt_accelerometer)


def carried_by(calibration: Calibration, S_w: FloatArray, measured: MoveMeasurements, segments: Segments) -> Carried:
    """:func:`carried` with a calibration's accelerometer and averaging, and the gyro's scale ``S_w`` (3, 3)."""
    accelerometer = calibration.accelerometer
    read = replace(measured, rate=_core.sharpened(measured.rate, measured.time_s, calibration.averaging))
    return carried(read, segments.time_mid_s[measured.links], accelerometer.S, accelerometer.b, S_w)


def without_g_sensitivity(measured: MoveMeasurements, own: Calibration | None) -> MoveMeasurements:
    """The moves without the g-sensitivity that the ``own`` calibration of their recording shows, if any."""
    shown = [] if own is None else [one for one in own.findings if one.code == "gyro-g-sensitivity"]
    if own is None or own.gyroscope is None or not shown:
        return measured
    lower = in_frame(own, "lower")
    assert lower.gyroscope is not None
    G = np.reshape([shown[0].numbers[f"G_{i}{j}"] for i in AXES for j in AXES], (3, 3))
    accelerometer = lower.accelerometer
    return measured.without_g_sensitivity(np.linalg.solve(lower.gyroscope.S, G), accelerometer.S, accelerometer.b)


def _across2(up: FloatArray, root: FloatArray) -> FloatArray:
    """(m,) variance across verticals (m, 3) of errors with roots (m, 3, k) of their covariance."""
    across = np.eye(3) - up[:, :, None] * up[:, None, :]
    return np.asarray(np.sum((across @ root) ** 2, axis=(1, 2)))


def _root(covariance: FloatArray) -> FloatArray:
    """L with L Lᵀ = C for covariances C (..., n, n) that are positive semidefinite up to rounding."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :])
