"""Calibration without reference attitudes: the norm of a static reading is gravity (docs/kalman.md, eq. 10)."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import XYZ, FloatArray
from trihedron.errors import InputError
from trihedron.estimate.accelerometer.poses import ENTRIES
from trihedron.estimate.kalman.per_axis import (
    check_innovations,
    consistency_findings,
    covariance_scale,
    is_settled,
    noise_per_axis,
    pose_arrays,
    shaping_model,
)
from trihedron.records.calibration import SensorCalibration
from trihedron.records.finding import Finding, FindingCode
from trihedron.records.kalman import AxisNoise, NormKalmanCalibration

START_RELATIVE, START_BIAS_M_S2 = 0.3, 3.0
"""Standard uncertainty of the initial S, relative to its size, and of the bias, by the range of the readings."""


def start_from_range(readings: npt.ArrayLike, gravity_m_s2: float) -> tuple[FloatArray, FloatArray]:
    """Initial scales (3,), biases (3,) in raw units, by the range of mean readings (n, 3): each axis was near the
    vertical, both ways up. The norm does not determine signs: those of the result are positive, as these.

    Raises ``InputError`` when an axis did not move.
    """
    a = np.asarray(readings, dtype=np.float64)
    half = np.ptp(a, axis=0) / 2.0
    if np.any(half <= 0):
        raise InputError(f"{XYZ[int(np.argmin(half))]} never changed: turn it both ways up")
    return gravity_m_s2 / half, (a.max(axis=0) + a.min(axis=0)) / 2.0


NormFrame = Literal["lower", "symmetric"]

MOST_RUNS = 50
N_PARAMETERS = 9


class NormFilter:
    """Kalman filter of a triad in unknown attitudes, over poses in order of time.

    ``noise`` of one axis or of three, in raw units; ``start`` the initial scales and biases (3,); ``frame`` the form
    of S, which fixes the rotation that the norm does not determine; ``session_s``, ``pose_s`` the approximate length of
    the session, which sets the slowest noise state, and of a pose.
    """

    def __init__(
        self,
        noise: AxisNoise | Sequence[AxisNoise],
        *,
        gravity_m_s2: float,
        start: tuple[FloatArray, FloatArray],
        frame: NormFrame = "lower",
        session_s: float = 1800.0,
        pose_s: float = 3.0,
    ) -> None:
        self.frame: NormFrame = frame
        self._gravity = gravity_m_s2
        scale, self._bias = start
        models = [shaping_model(n, session_s=session_s, pose_s=pose_s) for n in noise_per_axis(noise)]
        sigma = np.array([START_RELATIVE * scale.mean()] * 6 + [START_BIAS_M_S2] * 3)
        mean = np.array([scale[i] if i == j else 0.0 for i, j in ENTRIES] + [0.0] * 3)
        self._filter = _core.NormKalman(
            models[0], models[1], models[2], frame == "symmetric", gravity_m_s2, mean, sigma
        )
        self.n_runs = 0

    def add(self, reading: FloatArray, start_s: float, pose_s: float, extra_variance: FloatArray) -> None:
        """Update with the mean raw reading (3,) of one pose; ``extra_variance`` (3,), raw², adds to the noise model.

        Raises ``InputError`` when the reading is not finite or the pose is earlier than the last one.
        """
        self._filter.add([float(v) for v in reading - self._bias], start_s, pose_s, [float(v) for v in extra_variance])

    def load(self, readings: FloatArray, start_s: FloatArray, pose_s: FloatArray, extra_variance: FloatArray) -> None:
        """Store many poses, (n, 3), (n,), (n,), (n, 3), without an update; :meth:`relinearise` estimates from all."""
        self._filter.load(readings - self._bias, start_s, pose_s, np.ascontiguousarray(extra_variance))

    def relinearise(self, most: int = MOST_RUNS) -> bool:
        """Repeat the run over all poses until the constants converge; whether they did within ``most`` runs."""
        runs = self._filter.relinearise(most)
        self.n_runs = runs or 0
        return runs is not None

    def calibration(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """``S`` (3, 3), ``b`` (3,) and covariance (12, 12) of ``f = S raw + b``."""
        theta, jacobian = self._filter.parameters, self._expand()
        S, b = (jacobian[:9] @ theta).reshape(3, 3), theta[6:]
        # b = b_centred − S bias
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

    def innovations(self) -> tuple[FloatArray, FloatArray]:
        """Innovations (n,) of the latest run and their predicted standard deviations (n,), m/s²."""
        rows = self._filter.innovations
        return rows[:, 0].copy(), np.sqrt(rows[:, 1])


def calibrate_without_references(
    readings: npt.ArrayLike,
    noise: AxisNoise | Sequence[AxisNoise],
    *,
    start_s: npt.ArrayLike,
    pose_s: npt.ArrayLike,
    gravity_m_s2: float,
    frame: NormFrame = "lower",
    extra_variance: npt.ArrayLike = 0.0,
    raw_unit: str = "counts",
) -> NormKalmanCalibration:
    """Calibrate a triad from mean readings in unknown attitudes, with the estimate after every pose.

    Arguments are those of ``calibrate_with_references``. Raises ``InputError`` when shapes disagree, values are not
    finite, poses are out of order, or there are fewer than nine.
    """
    a = _mean_readings(readings)
    begin, pose, extra = pose_arrays(len(a), start_s, pose_s, extra_variance)

    def fresh() -> NormFilter:
        return NormFilter(
            noise,
            gravity_m_s2=gravity_m_s2,
            start=start_from_range(a, gravity_m_s2),
            frame=frame,
            session_s=float(begin[-1] + pose[-1] - begin[0]),
            pose_s=float(np.median(pose)),
        )

    parameters, sigmas = _track(fresh(), a, begin, pose, extra)
    # A run over all poses from the start: the result does not depend on the linearisation at the first poses.
    one = fresh()
    one.load(a, begin, pose, extra)
    converged = one.relinearise()
    S, b, covariance = one.calibration()
    parameters[-1], sigmas[-1] = _flat(S, b, covariance)
    innovation, innovation_sigma = one.innovations()
    seen = check_innovations(innovation, innovation_sigma)
    findings: list[Finding] = []
    if not converged:
        findings.append(Finding.of(FindingCode.NOT_CONVERGED, "kalman", most_runs=MOST_RUNS))
    findings += consistency_findings(None, seen)
    accelerometer = SensorCalibration(
        S, b, covariance_scale(seen) * covariance, raw_unit, "m/s^2", "kalman, norm of gravity"
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
        n_runs=one.n_runs,
        residual_m_s2=residual,
        consistency=seen,
        findings=tuple(findings),
    )


def _mean_readings(readings: npt.ArrayLike) -> FloatArray:
    a = np.array(readings, dtype=np.float64)
    if a.ndim != 2 or a.shape[1] != 3:
        raise InputError(f"readings must have shape (n, 3), got {a.shape}")
    n = len(a)
    if n < N_PARAMETERS:
        raise InputError(f"{n} poses give {n} equations for nine unknowns: record at least nine, better eighteen")
    if not np.all(np.isfinite(a)):
        raise InputError(f"pose {int(np.flatnonzero(~np.isfinite(a).all(axis=1))[0]) + 1}: the reading is not finite")
    return a


def _flat(S: FloatArray, b: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.concatenate([S.ravel(), b]), np.sqrt(np.maximum(np.diag(covariance), 0.0))


def _track(
    one: NormFilter, a: FloatArray, begin: FloatArray, pose: FloatArray, extra: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """S row by row and b, and their standard uncertainties, (n, 12) each, after every pose."""
    parameters, sigmas = np.empty((len(a), 12)), np.empty((len(a), 12))
    for i in range(len(a)):
        # The first 40 poses are relinearised each; later ones change the linearisation point by less than its error.
        again = i < 40 or i % 10 == 0
        one.add(a[i], float(begin[i]), float(pose[i]), extra[i])
        if again:
            one.relinearise(10)
        parameters[i], sigmas[i] = _flat(*one.calibration())
    return parameters, sigmas
