"""Calibration without reference attitudes: a reading at rest is as long as gravity (docs/kalman.md, eq. 10)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import AXES, FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.kalman.consistency import check_innovations, consistency_findings, is_settled
from trihedron.estimate.kalman.guide import Goal, Guide
from trihedron.estimate.kalman.norm_start import NormStart
from trihedron.estimate.kalman.per_axis import noise_per_axis, pose_arrays
from trihedron.estimate.kalman.shaping import ShapingOptions, shaping_model
from trihedron.records.calibration import Observability, SensorCalibration
from trihedron.records.finding import Finding, FindingCode
from trihedron.records.kalman import AxisNoise, LiveEstimate, NormKalmanCalibration

NormFrame = Literal["lower", "symmetric"]

ENTRIES = ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2))
"""Row and column in S of the filter's first six parameters."""

MOST_RUNS = 50
N_PARAMETERS = 9


class LiveNormCalibration:
    """Calibrate a triad in unknown attitudes while it is being turned.

    Parameters
    ----------
    noise : AxisNoise or three of them
        Noise of the raw readings.
    gravity_m_s2 : float
        Local gravity.
    start : NormStart
        Rough calibration to start from, signs included.
    frame : "lower" or "symmetric"
        Form of S, which fixes the rotation that the length of a vector leaves free.
    """

    def __init__(
        self,
        noise: AxisNoise | Sequence[AxisNoise],
        *,
        gravity_m_s2: float,
        start: NormStart,
        frame: NormFrame = "lower",
        goal: Goal | None = None,
        options: ShapingOptions | None = None,
        session_s: float = 1800.0,
        pose_s: float = 3.0,
        pause_s: float = 3.0,
    ) -> None:
        self.goal = goal or Goal()
        self.frame: NormFrame = frame
        self._gravity = gravity_m_s2
        self._pose, self._pause = pose_s, pause_s
        self._bias = start.bias
        options = options or ShapingOptions()
        models = [shaping_model(n, options, session_s=session_s, pose_s=pose_s) for n in noise_per_axis(noise)]
        size = np.abs(np.diag(start.S)).mean()
        sigma = np.array([start.sigma_relative * size] * 6 + [start.sigma_bias_m_s2] * 3)
        mean = np.array([start.S[i, j] for i, j in ENTRIES] + [0.0] * 3)
        self._filter = _core.NormKalman(
            models[0], models[1], models[2], frame == "symmetric", gravity_m_s2, mean, sigma
        )
        self.n_runs = 0

    @property
    def n_poses(self) -> int:
        """Poses taken so far."""
        return self._filter.n_poses

    def add(
        self,
        reading: npt.ArrayLike,
        *,
        start_s: float,
        pose_s: float,
        extra_variance: npt.ArrayLike = 0.0,
        relinearise: bool = True,
        look_ahead: int = 50,
    ) -> LiveEstimate:
        """Take the mean raw reading (3,) of one pose and say where things stand.

        ``relinearise`` repeats the run over all poses at the latest constants (milliseconds). ``next_reference`` of the
        answer is a direction of specific force in the body frame; ``constants`` are rows of ``[S | b]``.

        Raises
        ------
        ValueError
            When the reading is not finite or the pose is earlier than the last one.
        """
        a = np.asarray(reading, dtype=np.float64)
        if a.shape != (3,):
            raise RefusedError(f"a pose needs three readings, got shape {a.shape}")
        extra = [float(v) for v in np.broadcast_to(np.asarray(extra_variance, dtype=np.float64), (3,))]
        innovation, variance = self._filter.add([float(v) for v in a - self._bias], start_s, pose_s, extra)
        if relinearise:
            self.relinearise(10)
        return self.estimate(nis=np.full(3, innovation**2 / variance), look_ahead=look_ahead)

    def load(self, readings: FloatArray, start_s: FloatArray, pose_s: FloatArray, extra_variance: FloatArray) -> None:
        """Take many poses at once, (n, 3), (n,), (n,), (n, 3); :meth:`relinearise` then estimates from all of them."""
        self._filter.load(readings - self._bias, start_s, pose_s, np.ascontiguousarray(extra_variance))

    def relinearise(self, most: int = MOST_RUNS) -> bool:
        """Repeat the run over all poses until the constants stay; whether they did within ``most`` runs."""
        runs = self._filter.relinearise(most)
        self.n_runs = runs or 0
        return runs is not None

    def calibration(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """``S`` (3, 3), ``b`` (3,) and covariance (12, 12) of ``f = S raw + b``."""
        S, b = self._centred(self._filter)
        # b = b_centred − S zero
        jacobian = self._expand()
        for k in range(3):
            jacobian[9 + k] -= self._bias @ jacobian[3 * k : 3 * k + 3]
        return S, b - S @ self._bias, jacobian @ self._filter.covariance @ jacobian.T

    def _expand(self) -> FloatArray:
        """(12, 9) derivative of S row by row and b with respect to the nine parameters."""
        jacobian = np.zeros((12, N_PARAMETERS))
        for k, (i, j) in enumerate(ENTRIES):
            jacobian[3 * i + j, k] = 1.0
            if self.frame == "symmetric":
                jacobian[3 * j + i, k] = 1.0
        jacobian[9:, 6:] = np.eye(3)
        return jacobian

    def _centred(self, one: _core.NormKalman) -> tuple[FloatArray, FloatArray]:
        theta = one.parameters
        S: FloatArray = (self._expand()[:9] @ theta).reshape(3, 3)
        return S, theta[6:]

    def innovations(self) -> tuple[FloatArray, FloatArray]:
        """(n,) innovations of the latest run and their predicted standard deviations, m/s²."""
        rows = self._filter.innovations
        return rows[:, 0].copy(), np.sqrt(rows[:, 1])

    def _relative(self, one: _core.NormKalman) -> FloatArray:
        """(3, 4) standard errors of ``δf = E f + e``: E = δS S⁻¹ (dimensionless) and e = δb − E b [m/s²]."""
        S, b = self._centred(one)
        inverse = np.linalg.inv(S)
        expand = self._expand()
        jacobian = np.zeros((3, 4, N_PARAMETERS))
        for i in range(3):
            rows = np.einsum("jk,jp->kp", inverse, expand[3 * i : 3 * i + 3])
            jacobian[i, :3] = rows
            jacobian[i, 3] = expand[9 + i] - b @ rows
        flat = jacobian.reshape(12, N_PARAMETERS)
        variance = np.einsum("ip,pq,iq->i", flat, one.covariance, flat)
        relative: FloatArray = np.sqrt(np.maximum(variance, 0.0)).reshape(3, 4)
        return relative

    def _after(self, one: _core.NormKalman, direction: FloatArray) -> _core.NormKalman:
        S, b = self._centred(one)
        copy = one.copy()
        reading = np.linalg.solve(S, direction - b)
        copy.imagine([float(v) for v in reading], (one.end_s or 0.0) + self._pause, self._pose)
        return copy

    def estimate(self, *, nis: FloatArray | None = None, look_ahead: int = 50) -> LiveEstimate:
        """Where things stand now."""
        S, b, covariance = self.calibration()
        sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        guide = Guide(self.goal, self._gravity, self._after, self._relative)
        relative = self._relative(self._filter)
        good = self.n_poses >= N_PARAMETERS and self.goal.shortfall(relative) <= 1.0
        needed: int | None = 0 if good else None
        best: FloatArray | None = None
        if not good and look_ahead > 0:
            needed, best = guide.look_ahead(self._filter, None, look_ahead)
        return LiveEstimate(
            n_poses=self.n_poses,
            constants=np.column_stack([S, b]),
            sigma=np.column_stack([sigma[:9].reshape(3, 3), sigma[9:]]),
            relative_sigma=relative,
            good_enough=good,
            poses_needed=needed,
            next_reference=best,
            nis=np.full(3, np.nan) if nis is None else nis,
        )


def calibrate_without_references(
    readings: npt.ArrayLike,
    noise: AxisNoise | Sequence[AxisNoise],
    *,
    start_s: npt.ArrayLike,
    pose_s: npt.ArrayLike,
    gravity_m_s2: float,
    start: NormStart | None = None,
    frame: NormFrame = "lower",
    extra_variance: npt.ArrayLike = 0.0,
    options: ShapingOptions | None = None,
    raw_unit: str = "counts",
) -> NormKalmanCalibration:
    """Calibrate a triad from mean readings in unknown attitudes, with the track after every pose.

    Parameters
    ----------
    readings : (n, 3)
        Mean raw reading of each pose.
    noise : AxisNoise or three of them
        Noise of the raw readings.
    start_s, pose_s : (n,)
        When each pose starts and how long it lasts, s.
    start : NormStart, optional
        Default: guessed from the range of the readings, positive axes.
    extra_variance : scalar, (n,) or (n, 3)
        Variance of a reading on top of the noise model, raw².

    Raises
    ------
    ValueError
        When shapes disagree, values are not finite, poses are out of order, or there are fewer than nine.
    """
    a = _mean_readings(readings)
    begin, pose, extra = pose_arrays(len(a), start_s, pose_s, extra_variance)

    def fresh() -> LiveNormCalibration:
        return LiveNormCalibration(
            noise,
            gravity_m_s2=gravity_m_s2,
            start=start or NormStart.from_range(a, gravity_m_s2),
            frame=frame,
            options=options,
            session_s=float(begin[-1] + pose[-1] - begin[0]),
            pose_s=float(np.median(pose)),
        )

    parameters, sigmas = _track(fresh(), a, begin, pose, extra)
    # The answer does not depend on how the first few poses went: all together, from the start.
    live = fresh()
    live.load(a, begin, pose, extra)
    converged = live.relinearise()
    S, b, covariance = live.calibration()
    parameters[-1], sigmas[-1] = _flat(S, b, covariance)
    innovation, innovation_sigma = live.innovations()
    seen = check_innovations(innovation, innovation_sigma)
    findings: list[Finding] = []
    if not converged:
        findings.append(Finding.of(FindingCode.NOT_CONVERGED, "kalman", most_runs=MOST_RUNS))
    findings += consistency_findings(None, seen)
    observability, weak = _observability(live)
    findings += weak
    accelerometer = SensorCalibration(
        S, b, covariance, raw_unit, "m/s^2", "kalman, norm of gravity", observability=observability
    )
    residual = np.linalg.norm(a @ S.T + b, axis=1) - gravity_m_s2
    return NormKalmanCalibration(
        accelerometer=accelerometer,
        gravity_m_s2=gravity_m_s2,
        parameters=parameters,
        sigma=sigmas,
        innovation=innovation,
        innovation_sigma=innovation_sigma,
        is_settled=is_settled(innovation_sigma),
        n_runs=live.n_runs,
        residual_m_s2=residual,
        consistency=seen,
        findings=tuple(findings),
    )


def _mean_readings(readings: npt.ArrayLike) -> FloatArray:
    a = np.array(readings, dtype=np.float64)
    if a.ndim != 2 or a.shape[1] != 3:
        raise RefusedError(f"readings must have shape (n, 3), got {a.shape}")
    n = len(a)
    if n < N_PARAMETERS:
        raise RefusedError(f"{n} poses give {n} equations for nine unknowns: record at least nine, better eighteen")
    if not np.all(np.isfinite(a)):
        raise RefusedError(f"pose {int(np.flatnonzero(~np.isfinite(a).all(axis=1))[0]) + 1}: the reading is not finite")
    return a


def _flat(S: FloatArray, b: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.concatenate([S.ravel(), b]), np.sqrt(np.maximum(np.diag(covariance), 0.0))


def _track(
    live: LiveNormCalibration, a: FloatArray, begin: FloatArray, pose: FloatArray, extra: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """S row by row and b with standard errors (n, 12), as they stand after every pose."""
    parameters, sigmas = np.empty((len(a), 12)), np.empty((len(a), 12))
    for i in range(len(a)):
        # Every pose counts at first; later ones change the point of linearisation by less than its error.
        again = i < 40 or i % 10 == 0
        when = {"start_s": float(begin[i]), "pose_s": float(pose[i])}
        live.add(a[i], **when, extra_variance=extra[i], relinearise=again, look_ahead=0)
        parameters[i], sigmas[i] = _flat(*live.calibration())
    return parameters, sigmas


def _observability(live: LiveNormCalibration) -> tuple[Observability, list[Finding]]:
    """Directions of the nine parameters, from the covariance of ``[E | e/g]``."""
    covariance = live._filter.covariance
    S, _ = live._centred(live._filter)
    scale = np.array([1.0 / np.abs(np.diag(S))[j] for _, j in ENTRIES] + [1.0 / live._gravity] * 3)
    values = np.linalg.eigvalsh(scale[:, None] * covariance * scale)
    singular = 1.0 / np.sqrt(np.maximum(values, 1e-300))
    condition = float(singular[0] / singular[-1])
    direction = np.linalg.eigh(scale[:, None] * covariance * scale)[1][:, -1]
    names = (*(f"S_{AXES[i]}{AXES[j]}" for i, j in ENTRIES), "b_x", "b_y", "b_z")
    weakest = names[int(np.argmax(np.abs(direction)))]
    findings: list[Finding] = []
    if condition > 100.0:
        findings.append(Finding.of(FindingCode.WEAKLY_OBSERVABLE, "kalman-norm", weakest=weakest, condition=condition))
    return Observability(int(np.sum(singular > 1e-9 * singular[0])), 9, condition, singular, weakest=weakest), findings
