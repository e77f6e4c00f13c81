"""The digital twin: the calibrated model with every hidden state of one session, and its linearised residuals.

Unknowns: accelerometer S (lower) and b, gyro S, and for every hold the vertical in the body (2 angles), the gyro bias
and the slow part of the accelerometer bias. Both biases are random walks whose strength comes from the corner time of
the sensor's noise (docs/diagnosis.md, eq. 8.1-8.6). Every residual is whitened by the noise predicted for it, so a
healthy recording gives rows of standard normal numbers.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.diagnose.session.observations import FloatArray, Observations

STATIC_ACCEL, STATIC_GYRO, MOVES, DYNAMICS, PRIOR = range(5)
"""Labels of residual rows; ``PRIOR`` rows keep flat directions finite and belong to no domain."""

_LOWER: tuple[tuple[int, int], ...] = ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2))
_FULL = tuple((i, j) for i in range(3) for j in range(3))
N_ACCEL, N_GYRO, N_HOLD = 9, 9, 8
"""Unknowns: accelerometer, gyro, and per hold (2 tilt, 3 gyro bias, 3 accelerometer bias)."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Values the fit is pulled to with their covariance (18 unknowns, centred model).

    A given calibration, which the recording may contradict, or, if ``is_weak``, what holds for any such instrument.
    """

    mean: FloatArray
    covariance: FloatArray
    is_weak: bool = False


@dataclass(frozen=True, eq=False)
class Twin:
    """State of the model. ``accel_S``, ``accel_b``, ``gyro_S`` act on centred raw readings; the rest is per hold."""

    gravity: float
    accel_S: FloatArray
    accel_b: FloatArray
    gyro_S: FloatArray
    up: FloatArray
    gyro_bias: FloatArray
    accel_bias: FloatArray
    gyro_corner_s: float
    accel_corner_s: float
    effect: FloatArray

    def advanced(self, step: FloatArray) -> Twin:
        """The state moved by a step in the unknowns (and effect parameters, if the step carries them)."""
        n = len(self.up)
        accel_S = self.accel_S.copy()
        for k, (i, j) in enumerate(_LOWER):
            accel_S[i, j] += step[k]
        holds = step[N_ACCEL + N_GYRO : N_ACCEL + N_GYRO + N_HOLD * n].reshape(n, N_HOLD)
        up = self.up + np.einsum("nij,nj->ni", tangents(self.up), holds[:, :2])
        return replace(
            self,
            accel_S=accel_S,
            accel_b=self.accel_b + step[6:9],
            gyro_S=self.gyro_S + step[9:18].reshape(3, 3),
            up=up / np.linalg.norm(up, axis=1, keepdims=True),
            gyro_bias=self.gyro_bias + holds[:, 2:5],
            accel_bias=self.accel_bias + holds[:, 5:8],
            effect=self.effect + step[N_ACCEL + N_GYRO + N_HOLD * n :],
        )


@dataclass(frozen=True, eq=False)
class Distortion:
    """What effects add to the corrected readings, linear in their parameters: SI, instrument frame.

    ``force`` and ``rate`` (points, 3, K) or None, at the points of :class:`Trajectory` (holds, then move samples).
    """

    force: FloatArray | None
    rate: FloatArray | None

    @property
    def n_parameters(self) -> int:
        """Number of effect parameters."""
        given = self.force if self.force is not None else self.rate
        return 0 if given is None else int(given.shape[2])


NO_DISTORTION = Distortion(None, None)


def stacked(parts: list[Distortion]) -> Distortion:
    """Several distortions side by side."""
    parts = [p for p in parts if p.n_parameters]
    if not parts:
        return NO_DISTORTION

    def side(name: str) -> FloatArray | None:
        given = [getattr(p, name) for p in parts]
        present = next((g for g in given if g is not None), None)
        if present is None:
            return None
        shape = present.shape[:2]
        blocks = [np.zeros((*shape, p.n_parameters)) if g is None else g for p, g in zip(parts, given, strict=True)]
        return np.concatenate(blocks, axis=2)

    return Distortion(side("force"), side("rate"))


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The motion as the twin sees it, at its *points*: one per hold, then every sample of every move.

    ``force`` (points, 3) specific force and ``rate`` (points, 3) angular rate in SI, corrected by the twin (distortions
    of accepted effects removed); ``attitude`` (move samples, 3, 3) rotation since the move began; ``move_slices`` the
    points of each move.
    """

    force: FloatArray
    rate: FloatArray
    attitude: FloatArray
    move_slices: tuple[slice, ...]
    point_samples: npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class System:
    """Whitened residuals and Jacobians: ``residual`` (rows,), ``jacobian`` (rows, unknowns), row labels.

    ``columns(distortion)`` gives the whitened rows of further effect parameters. ``log_weight`` is the log-determinant
    of the whitening of rows whose noise depends on the corner times; ``walk`` marks them (1 accelerometer, 2 gyro).
    """

    residual: FloatArray
    jacobian: FloatArray
    domain: npt.NDArray[np.int8]
    segment: npt.NDArray[np.intp]
    channel: npt.NDArray[np.int8]
    log_weight: float
    walk: npt.NDArray[np.int8]


def tangents(up: FloatArray) -> FloatArray:
    """(n, 3, 2) orthonormal bases of the planes normal to unit vectors (n, 3)."""
    helper = np.zeros_like(up)
    helper[np.arange(len(up)), np.abs(up).argmin(axis=1)] = 1.0
    first = np.cross(up, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(up, first)], axis=2)


def trajectory(obs: Observations, twin: Twin, distortion: Distortion) -> Trajectory:
    """Corrected motion at every point (eq. 8.2)."""
    h = obs.n_holds
    samples = [np.arange(start, stop) for start, stop in obs.move_ranges]
    slices, first = [], h
    for part in samples:
        slices.append(slice(first, first + len(part)))
        first += len(part)
    index = np.concatenate(samples) if samples else np.zeros(0, dtype=np.intp)
    bias_rate, bias_force = np.zeros((len(index), 3)), np.zeros((len(index), 3))
    for part, where, (before, after) in zip(samples, slices, obs.move_holds, strict=True):
        t = obs.time_s[part]
        blend = ((t - t[0]) / max(t[-1] - t[0], 1e-12))[:, None]
        rows = slice(where.start - h, where.stop - h)
        bias_rate[rows] = twin.gyro_bias[before] * (1 - blend) + twin.gyro_bias[after] * blend
        bias_force[rows] = twin.accel_bias[before] * (1 - blend) + twin.accel_bias[after] * blend
    hold_force = twin.gravity * twin.up
    move_force = obs.raw_force[index] @ twin.accel_S.T + twin.accel_b - bias_force
    if distortion.force is not None:
        move_force = move_force - distortion.force[h:] @ twin.effect
    rate = np.zeros((h + len(index), 3))
    if obs.raw_rate is not None:
        rate[h:] = obs.raw_rate[index] @ twin.gyro_S.T - bias_rate
        if distortion.rate is not None:
            rate[h:] -= distortion.rate[h:] @ twin.effect
    local = [(s.start - h, s.stop - h) for s in slices]
    attitude = (
        _core.attitude_in_moves(np.ascontiguousarray(obs.time_s[index]), np.ascontiguousarray(rate[h:]), local)
        if local
        else np.zeros((0, 3, 3))
    )
    mid = np.array([(hold.start + hold.stop) // 2 for hold in obs.segments.holds], dtype=np.intp)
    return Trajectory(np.vstack([hold_force, move_force]), rate, attitude, tuple(slices), np.concatenate([mid, index]))


class Linearisation:
    """Whitened residual rows of one twin on one recording, and the means to add columns to them."""

    def __init__(self, obs: Observations, twin: Twin, distortion: Distortion, prior: Prior | None = None) -> None:
        self.obs, self.twin, self.distortion, self.prior = obs, twin, distortion, prior
        self.path = trajectory(obs, twin, distortion)
        self.tangent = tangents(twin.up)
        self._moves = [self._move(m) for m in range(obs.n_moves)]
        # The raw reading is the datum: its noise is fixed in raw units, and S enters a rest row through S⁻¹ alone. A
        # residual S w - β whitened by S R Sᵀ with S held fixed pulls S to zero wherever β scatters (eq. 8.1a).
        self._accel_inverse = np.linalg.inv(twin.accel_S)
        self._gyro_inverse = np.linalg.inv(twin.gyro_S)
        self._accel_white = self._accel_inverse / obs.hold_force_sigma[:, :, None]
        self._gyro_white = None
        if obs.hold_rate_sigma is not None:
            self._gyro_white = self._gyro_inverse / obs.hold_rate_sigma[:, :, None]

    def at_twin(self, twin: Twin, distortion: Distortion) -> Linearisation:
        """The same linearisation for a twin at the same point (noise corners or idle effects may differ)."""
        out = copy(self)
        out.twin, out.distortion = twin, distortion
        return out

    # -- one move -------------------------------------------------------------------------------------------------
    def _move(self, m: int) -> dict[str, FloatArray]:
        obs, twin, path = self.obs, self.twin, self.path
        where = path.move_slices[m]
        h = obs.n_holds
        before, after = obs.move_holds[m]
        t = obs.time_s[path.point_samples[where]]
        dt = np.diff(t)
        weight = np.zeros(len(t))
        weight[:-1] += dt / 2
        weight[1:] += dt / 2
        C = path.attitude[where.start - h : where.stop - h]
        lifted = np.einsum("nji,nj->ni", C, path.force[where])  # specific force in the frame of the move's start
        tail = np.cumsum((weight[:, None] * lifted)[::-1], axis=0)[::-1] - 0.5 * weight[:, None] * lifted
        duration = t[-1] - t[0]
        tangent_after = self.tangent[after]
        lever = twin.gravity * tangent_after.T @ C[-1]
        residual_m = lever @ twin.up[before] - twin.gravity * tangent_after.T @ twin.up[after]
        residual_v = (weight[:, None] * lifted).sum(axis=0) - twin.gravity * duration * twin.up[before]
        # Noise: attitude error is a Wiener process of the gyro's white noise, velocity its integral over the force.
        assert obs.rate_density is not None
        q = np.einsum("ij,j->i", twin.gyro_S**2, obs.rate_density**2).mean()
        qa = np.einsum("ij,j->i", twin.accel_S**2, obs.force_density**2).mean()
        A = lever @ _skew(twin.up[before])
        fast = obs.unresolved.get((int(before), int(after)))
        if fast is not None:
            qa += float((twin.accel_S**2 @ fast[0]).mean()) / duration
            q += float((twin.gyro_S**2 @ fast[1]).mean()) / duration
        if obs.jitter_s:
            # A sample taken δ late reads δ·derivative more: white over samples, stronger where the motion is quick.
            step = duration / max(len(t) - 1, 1)
            q += obs.jitter_s**2 * step * float((np.gradient(path.rate[where], t, axis=0) ** 2).mean())
            qa += obs.jitter_s**2 * step * float((np.gradient(path.force[where], t, axis=0) ** 2).mean())
        outer = (weight[:, None, None] * tail[:, :, None] * tail[:, None, :]).sum(axis=0)
        cov = np.zeros((5, 5))
        cov[:2, :2] = q * duration * A @ A.T
        cov[2:, 2:] = q * (np.trace(outer) * np.eye(3) - outer) + qa * duration * np.eye(3)
        cross = q * A @ _skew((weight[:, None] * tail).sum(axis=0))
        cov[:2, 2:], cov[2:, :2] = cross, cross.T
        tail_skew = np.zeros((len(t), 3, 3))
        tail_skew[:, [0, 1, 2], [1, 2, 0]] = -(weight[:, None] * tail)[:, [2, 0, 1]]
        tail_skew[:, [1, 2, 0], [0, 1, 2]] = (weight[:, None] * tail)[:, [2, 0, 1]]
        weighted_Ct = (weight[:, None, None] * C.transpose(0, 2, 1)).transpose(1, 0, 2).reshape(3, -1)
        tail_Ct = (tail_skew @ C.transpose(0, 2, 1)).transpose(1, 0, 2).reshape(3, -1)
        # ψ(t) = ∫ Cᵀ δω: its end moves the predicted vertical, its product with the force the velocity. Written as sums
        # over samples with the force still to come, so that one product gives the rows of many columns.
        by_rate = np.vstack([A @ weighted_Ct, -tail_Ct])
        widened = np.r_[np.full(2, obs.moves_inflation), np.full(3, obs.dynamics_inflation)]
        cov *= np.outer(widened, widened)
        return {
            "by_rate": by_rate, "by_force": weighted_Ct,
            "t": t, "weight": weight, "dt": dt, "C": C, "lifted": lifted, "lever": lever,
            "residual": np.concatenate([residual_m, residual_v]),
            "white": np.linalg.inv(np.linalg.cholesky(cov)), "duration": np.array(duration),
        }  # fmt: skip

    def move_residual(self, m: int) -> FloatArray:
        """(5,) whitened residuals of one move: gravity in its end pose (2), velocity over it (3)."""
        one = self._moves[m]
        out: FloatArray = one["white"] @ one["residual"]
        return out

    def _move_rows(self, m: int, rate: FloatArray | None, force: FloatArray | None) -> FloatArray:
        """(5, K) change of a move's residuals when true rate and force change by (samples, 3, K)."""
        one = self._moves[m]
        given = rate if rate is not None else force
        assert given is not None
        out = np.zeros((5, given.shape[2]))
        if rate is not None:
            out += one["by_rate"] @ rate.reshape(-1, rate.shape[2])
        if force is not None:
            out[2:] += one["by_force"] @ force.reshape(-1, force.shape[2])
        return out

    # -- everything -----------------------------------------------------------------------------------------------
    def columns(self, distortion: Distortion) -> FloatArray:
        """(rows, K) whitened change of every residual row per effect parameter (eq. 8.4)."""
        h = self.obs.n_holds
        k = distortion.n_parameters
        parts = []
        force = distortion.force
        parts.append(np.zeros((3 * h, k)) if force is None else -(self._accel_white @ force[:h]).reshape(3 * h, k))
        if self._gyro_white is not None:
            rate = distortion.rate
            parts.append(np.zeros((3 * h, k)) if rate is None else -(self._gyro_white @ rate[:h]).reshape(3 * h, k))
        for m, where in enumerate(self.path.move_slices):
            rate_part = None if distortion.rate is None else distortion.rate[where]
            force_part = None if force is None else force[where]
            parts.append(-self._moves[m]["white"] @ self._move_rows(m, rate_part, force_part))
        parts.append(np.zeros((self._n_prior_rows(), k)))
        return np.vstack(parts)

    def _n_prior_rows(self) -> int:
        h = self.obs.n_holds
        return 6 * h + (18 if self.prior is not None else 0)

    def system(self) -> System:
        """Whitened residuals and their Jacobian in the baseline unknowns."""
        obs, twin, h = self.obs, self.twin, self.obs.n_holds
        n = N_ACCEL + N_GYRO + N_HOLD * h

        def at(hold: int, part: slice) -> slice:
            first = N_ACCEL + N_GYRO + N_HOLD * hold
            return slice(first + part.start, first + part.stop)

        tilt, rate_bias, force_bias = slice(0, 2), slice(2, 5), slice(5, 8)
        rows_r: list[FloatArray] = []
        rows_j: list[FloatArray] = []
        label: list[tuple[int, int, int, int]] = []
        eye = np.eye(3)
        for i in range(h):
            true = twin.gravity * twin.up[i] + twin.accel_bias[i] - twin.accel_b
            if self.distortion.force is not None:
                true = true + self.distortion.force[i] @ twin.effect
            r = twin.accel_S @ obs.hold_force[i] - true
            read = self._accel_inverse @ true
            J = np.zeros((3, n))
            for k, (row, col) in enumerate(_LOWER):
                J[row, k] = read[col]  # ∂/∂S of w - S⁻¹ true, times S
            J[:, 6:9] = eye
            J[:, at(i, tilt)] = -twin.gravity * self.tangent[i]
            J[:, at(i, force_bias)] = -eye
            W = self._accel_white[i]
            rows_r.append(W @ r)
            rows_j.append(W @ J)
            label += [(STATIC_ACCEL, i, c, 0) for c in range(3)]
        if self._gyro_white is not None:
            assert obs.hold_rate is not None
            for i in range(h):
                true = twin.gyro_bias[i]
                if self.distortion.rate is not None:
                    true = true + self.distortion.rate[i] @ twin.effect
                r = twin.gyro_S @ obs.hold_rate[i] - true
                J = np.zeros((3, n))
                J[:, 9:18] = np.kron(eye, (self._gyro_inverse @ true)[None])
                J[:, at(i, rate_bias)] = -eye
                W = self._gyro_white[i]
                rows_r.append(W @ r)
                rows_j.append(W @ J)
                label += [(STATIC_GYRO, i, c, 0) for c in range(3)]
        for m in range(obs.n_moves):
            one, where = self._moves[m], self.path.move_slices[m]
            before, after = obs.move_holds[m]
            sample = self.path.point_samples[where]
            assert obs.raw_rate is not None
            blend = (one["t"] - one["t"][0]) / max(one["t"][-1] - one["t"][0], 1e-12)
            two = np.concatenate([(1 - blend)[:, None, None] * eye, blend[:, None, None] * eye], axis=2)
            J = np.zeros((5, n))
            by_S = np.einsum("ia,nj->niaj", eye, obs.raw_rate[sample]).reshape(len(sample), 3, 9)
            by_bias = -two
            rate_cols = self._move_rows(m, np.concatenate([by_S, by_bias], axis=2), None)
            J[:, 9:18] = rate_cols[:, :9]
            J[:, at(before, rate_bias)] = rate_cols[:, 9:12]
            J[:, at(after, rate_bias)] = rate_cols[:, 12:15]
            lower = np.zeros((len(sample), 3, 6))
            for k, (row, col) in enumerate(_LOWER):
                lower[:, row, k] = obs.raw_force[sample, col]
            force_cols = self._move_rows(
                m, None, np.concatenate([lower, np.broadcast_to(eye, (len(sample), 3, 3)), -two], axis=2)
            )
            J[:, :9] = force_cols[:, :9]
            J[:, at(before, force_bias)] = force_cols[:, 9:12]
            J[:, at(after, force_bias)] = force_cols[:, 12:15]
            J[:2, at(before, tilt)] = one["lever"] @ self.tangent[before]
            J[:2, at(after, tilt)] = -twin.gravity * np.eye(2)
            J[2:, at(before, tilt)] = -twin.gravity * float(one["duration"]) * self.tangent[before]
            rows_r.append(one["white"] @ one["residual"])
            rows_j.append(one["white"] @ J)
            label += [(MOVES, m, c, 0) for c in range(2)] + [(DYNAMICS, m, c, 0) for c in range(3)]
        log_weight = self._walk_rows(rows_r, rows_j, label, n)
        if self.prior is not None:
            current = np.concatenate([[twin.accel_S[i, j] for i, j in _LOWER], twin.accel_b, twin.gyro_S.ravel()])
            W = np.linalg.inv(np.linalg.cholesky(self.prior.covariance))
            J = np.zeros((18, n))
            J[:, :18] = W
            rows_r.append(W @ (current - self.prior.mean))
            rows_j.append(J)
            # Where a given calibration is contradicted, its sensor's own domain says so.
            blamed = (PRIOR, PRIOR) if self.prior.is_weak else (STATIC_ACCEL, MOVES)
            label += [(blamed[0], 0, k % 3, 3) for k in range(9)] + [(blamed[1], 0, k % 3, 3) for k in range(9)]
        labels = np.array(label)
        jacobian = np.vstack(rows_j)
        return System(
            residual=np.concatenate(rows_r), jacobian=jacobian, domain=labels[:, 0].astype(np.int8),
            segment=labels[:, 1], channel=labels[:, 2].astype(np.int8), walk=labels[:, 3].astype(np.int8),
            log_weight=log_weight,
        )  # fmt: skip

    def _walk_rows(
        self,
        rows_r: list[FloatArray],
        rows_j: list[FloatArray],
        label: list[tuple[int, int, int, int]],
        n: int,
    ) -> float:
        """Random walks of both biases between holds (eq. 8.3); the first hold carries a flat prior."""
        obs, twin, h = self.obs, self.twin, self.obs.n_holds
        log_weight = 0.0
        gap = np.maximum(np.diff(obs.hold_time_s), 1e-3)
        # As at rest: the walk is that of the raw zero, its strength fixed in raw units, so that S cannot buy itself a
        # smaller step by shrinking: ∂(S⁻¹ Δβ) = -S⁻¹ ∂S S⁻¹ Δβ.
        sensors = [
            (5, twin.accel_bias, self._accel_inverse, obs.force_density, twin.accel_corner_s, STATIC_ACCEL, 0, _LOWER)
        ]
        if obs.rate_density is not None:
            sensors.append(
                (2, twin.gyro_bias, self._gyro_inverse, obs.rate_density, twin.gyro_corner_s, STATIC_GYRO, 9, _FULL)
            )
        for offset, bias, inverse, density, corner_s, domain, first_scale, entries in sensors:
            walk = np.sqrt(3.0) * density / corner_s  # K with N²/τ = K²τ/3 at the corner τ
            first = N_ACCEL + N_GYRO + offset
            # The accelerometer's constant bias is b itself; the gyro's is only held finite.
            sigma = 1e-6 * np.linalg.norm(np.linalg.inv(inverse) * density, axis=1) if offset == 5 else np.full(3, 10.0)
            J = np.zeros((3, n))
            J[:, first : first + 3] = np.diag(1 / sigma)
            rows_r.append(bias[0] / sigma)
            rows_j.append(J)
            label += [(PRIOR, 0, c, 0) for c in range(3)]
            for i in range(h - 1):
                sigma = walk * np.sqrt(gap[i])
                here, there = first + N_HOLD * i, first + N_HOLD * (i + 1)
                white = inverse / sigma[:, None]
                change = inverse @ (bias[i + 1] - bias[i])
                J = np.zeros((3, n))
                J[:, there : there + 3] = white
                J[:, here : here + 3] = -white
                for k, (row, col) in enumerate(entries):
                    J[:, first_scale + k] = -white[:, row] * change[col]
                rows_r.append(change / sigma)
                rows_j.append(J)
                label += [(domain, i, c, 1 if offset == 5 else 2) for c in range(3)]
                log_weight += float(np.log(abs(np.linalg.det(inverse)))) - float(np.log(sigma).sum())
        if obs.rate_density is None:
            # No gyro: its unknowns per hold are pinned so that the system stays regular.
            for i in range(h):
                J = np.zeros((3, n))
                first = N_ACCEL + N_GYRO + N_HOLD * i + 2
                J[:, first : first + 3] = np.eye(3)
                rows_r.append(np.zeros(3))
                rows_j.append(J)
                label += [(PRIOR, i, c, 0) for c in range(3)]
        return log_weight


def _skew(v: FloatArray) -> FloatArray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
