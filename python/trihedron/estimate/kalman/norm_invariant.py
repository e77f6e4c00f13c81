"""Calibration without reference attitudes: the norm of a static reading is gravity (docs/kalman.md, eq. 10)."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import XYZ, FloatArray, sigmas_of
from trihedron.errors import InputError
from trihedron.estimate.accelerometer.norm import N_PARAMETERS
from trihedron.estimate.accelerometer.poses import ENTRIES
from trihedron.estimate.kalman.per_axis import (
    check_innovations,
    consistency_findings,
    covariance_scale,
    is_settled,
    noise_per_axis,
    shaping_model,
)
from trihedron.records import AxisNoise, Finding, NormKalmanCalibration, SensorCalibration

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


def calibrate_without_references(
    readings: npt.ArrayLike,
    noise: AxisNoise | Sequence[AxisNoise],
    *,
    start_s: FloatArray,
    pose_s: FloatArray,
    gravity_m_s2: float,
    frame: NormFrame = "lower",
    extra_variance: FloatArray | float = 0.0,
    raw_unit: str = "counts",
) -> NormKalmanCalibration:
    """Calibrate a triad from mean readings in unknown attitudes, with the estimate after every pose.

    Arguments are those of ``calibrate_with_references``. Raises ``InputError`` when shapes disagree, values are not
    finite, poses are out of order, or there are fewer than nine.
    """
    a = _mean_readings(readings)
    extra = np.broadcast_to(extra_variance, a.shape)
    session_s, usual_s = float(start_s[-1] + pose_s[-1] - start_s[0]), float(np.median(pose_s))
    x, y, z = (shaping_model(one, session_s=session_s, pose_s=usual_s) for one in noise_per_axis(noise))
    scale, middle = start_from_range(a, gravity_m_s2)
    mean = np.array([scale[i] if i == j else 0.0 for i, j in ENTRIES] + [0.0] * 3)
    sigma = np.array([START_RELATIVE * scale.mean()] * 6 + [START_BIAS_M_S2] * 3)

    def fresh() -> _core.NormKalman:
        return _core.NormKalman(x, y, z, frame == "symmetric", gravity_m_s2, mean, sigma)

    wrt = _wrt_parameters(frame, middle)
    parameters, sigmas = _track(fresh(), wrt, (a - middle, start_s, pose_s, extra))
    # A run over all poses from the start: the result does not depend on the linearisation at the first poses.
    one = fresh()
    one.load(a - middle, start_s, pose_s, np.ascontiguousarray(extra))
    is_converged = one.relinearise(MOST_RUNS) is not None
    parameters[-1], covariance = wrt @ one.parameters, wrt @ one.covariance @ wrt.T
    sigmas[-1] = sigmas_of(covariance)
    S, b = parameters[-1, :9].reshape(3, 3).copy(), parameters[-1, 9:].copy()
    innovation, innovation_sigma = one.innovations[:, 0].copy(), np.sqrt(one.innovations[:, 1])
    seen = check_innovations(innovation, innovation_sigma, N_PARAMETERS)
    findings: list[Finding] = []
    if not is_converged:
        findings.append(Finding.of("not-converged", "kalman", most_runs=MOST_RUNS))
    findings += consistency_findings(None, seen)
    accelerometer = SensorCalibration(
        S, b, covariance_scale(seen) * covariance, raw_unit, "m/s^2", "kalman, norm of gravity"
    )
    residual = np.linalg.norm(a @ S.T + b, axis=1) - gravity_m_s2
    return NormKalmanCalibration(
        accelerometer=accelerometer,
        parameters=parameters,
        sigma=sigmas,
        innovation=innovation,
        innovation_sigma=innovation_sigma,
        is_settled=is_settled(innovation_sigma, N_PARAMETERS),
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
        raise InputError(f"nine unknowns need nine poses or more, better eighteen; got {n}")
    if not np.all(np.isfinite(a)):
        raise InputError(f"pose {int(np.flatnonzero(~np.isfinite(a).all(axis=1))[0]) + 1}: the reading is not finite")
    return a


def _wrt_parameters(frame: NormFrame, middle: FloatArray) -> FloatArray:
    """(12, 9) derivative of S row by row and b with respect to the nine parameters: S and b of readings about
    ``middle`` (3,)."""
    out = np.zeros((12, N_PARAMETERS))
    for k, (i, j) in enumerate(ENTRIES):
        out[3 * i + j, k] = 1.0
        if frame == "symmetric":
            out[3 * j + i, k] = 1.0
    out[9:, 6:] = np.eye(3)
    out[9:] -= np.einsum("j,ijk->ik", middle, out[:9].reshape(3, 3, N_PARAMETERS))
    return out


def _track(
    one: _core.NormKalman, wrt: FloatArray, poses: tuple[FloatArray, FloatArray, FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """S row by row and b, and their standard uncertainties, (n, 12) each, after every pose."""
    parameters, sigmas = [], []
    for i, (reading, begin_s, pose_s, extra) in enumerate(zip(*poses, strict=True)):
        one.add(reading.tolist(), float(begin_s), float(pose_s), extra.tolist())
        # The first 40 poses are relinearised each; later ones change the linearisation point by less than its error.
        if i < 40 or i % 10 == 0:
            one.relinearise(10)
        parameters.append(wrt @ one.parameters)
        sigmas.append(sigmas_of(wrt @ one.covariance @ wrt.T))
    return np.array(parameters), np.array(sigmas)
