"""What the zeros of one session show, per sensor: asked by several effects, computed once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import CORNER_GRID_S
from trihedron.diagnose.zeros.evidence import FEWEST_POSES, ZeroEvidence, examine
from trihedron.diagnose.zeros.readings import SessionZeros, accel_zeros, gyro_zeros
from trihedron.records.diagnosis import EffectParameter

FEWEST_FOR_SIZE = 6
"""Poses from which the size of the gyro's scatter is told at all."""
FEWEST_NORM_POSES = FEWEST_POSES
"""|f| is one number a pose and nine of them are spent on S and b: below this nothing is said of the accelerometer."""
STANDS_OUT = 1e-3
"""Largest p-value, beside scatter, walk and drift, of an effect that the session's fit has found already."""
LEAST_OVER_NOISE = 4.0
"""Scatter over the error of a pose's mean, in variance. That error is itself measured, to 10 or 20 %, and flicker makes
zeros wander between poses: of seven healthy sessions of a tactical unit one reached 2.8. Less than twice the error is
the sensor's noise, not a flaw."""
AXES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class SessionEvidence:
    """Zeros of one sensor with their tests."""

    zeros: SessionZeros
    evidence: ZeroEvidence


@lru_cache(maxsize=4)
def gyro_evidence(context: Context) -> SessionEvidence | None:
    """Tests of the gyro's zeros; ``None`` without a gyro or with fewer than six poses."""
    if context.obs.n_holds < FEWEST_FOR_SIZE:
        return None
    zeros = gyro_zeros(context)
    if zeros is None or zeros.readings.n_poses < FEWEST_FOR_SIZE:
        return None
    found = examine(zeros.readings, list(zeros.thermal), list(zeros.gravity))
    return SessionEvidence(zeros, found)


@lru_cache(maxsize=4)
def accel_evidence(context: Context) -> SessionEvidence | None:
    """Tests of the accelerometer's zeros, as its poses' lengths show them; ``None`` with fewer than 15 poses."""
    if context.obs.n_holds < FEWEST_NORM_POSES:
        return None
    zeros = accel_zeros(context)
    if zeros is None or zeros.readings.n_poses < FEWEST_NORM_POSES:
        return None
    return SessionEvidence(zeros, examine(zeros.readings, list(zeros.thermal), None, is_norm=True))


def scatter_parameters(found: SessionEvidence, unit: str) -> tuple[EffectParameter, ...]:
    """Size of the scatter, per axis of a gyro, one of an accelerometer."""
    sizes, errors = found.evidence.scatter, found.evidence.scatter_std
    names = ("sigma",) if len(sizes) == 1 else tuple(f"sigma_{axis}" for axis in AXES)
    return tuple(
        EffectParameter(name, float(size), float(error), unit)
        for name, size, error in zip(names, sizes, errors, strict=True)
    )


def exceeds_noise(found: SessionEvidence) -> bool:
    """Whether the scatter is at least as large as the errors of the poses' means.

    Of the pose in the middle: a mean over poses is that of the worst, and two restless ones would hide any scatter.
    """
    noise = float(np.median((found.zeros.readings.sigma**2).mean(axis=0))) / 2.0
    return float(np.mean(found.evidence.scatter**2)) > LEAST_OVER_NOISE * noise


def share_of_zeros(found: SessionEvidence) -> float:
    """Variance of the scatter over all that zeros vary by from pose to pose, effects of the catalogue included."""
    scatter = float(np.sum(found.evidence.scatter**2))
    return scatter / max(float(found.zeros.varied.sum()), scatter, 1e-300)


def share_of_curve(found: SessionEvidence, rms: FloatArray) -> float:
    """Variance of a drift's curve over all that zeros vary by from pose to pose."""
    drift = float(np.sum(rms**2))
    return drift / max(float(found.zeros.varied.sum()), drift, 1e-300)


def walk_of_noise(context: Context) -> float:
    """rms, rad/s, that the gyros' white noise could walk about its mean in the session, at the earliest corner."""
    obs, twin = context.obs, context.fitted.twin
    assert obs.rate_density is not None
    density = float(np.sqrt(((twin.gyro_S**2) @ obs.rate_density**2).mean()))
    span = max(float(obs.hold_time_s[-1] - obs.hold_time_s[0]), 1.0)
    # K = √3 N/τ (eq. 8.3), and a walk has a sixth of K² T about its mean.
    return float(np.sqrt(3.0) * density / CORNER_GRID_S[0] * np.sqrt(span / 6.0))


def with_gyro_scatter(obs: Observations, sigma: FloatArray, si_per_raw: FloatArray) -> Observations:
    """Zeros of the gyro that scatter by ``sigma`` (3,) rad/s from pose to pose, during moves too."""
    return _with_scatter(obs, 1, sigma / si_per_raw)


def with_accel_scatter(obs: Observations, sigma: float, si_per_raw: FloatArray) -> Observations:
    """Zeros of the accelerometer that scatter by ``sigma`` m/s² per axis from pose to pose, during moves too."""
    return _with_scatter(obs, 0, sigma / si_per_raw)


def _with_scatter(obs: Observations, sensor: int, raw: FloatArray) -> Observations:
    scatter = np.zeros((2, 3)) if obs.zero_scatter is None else obs.zero_scatter.copy()
    scatter[sensor] = np.hypot(scatter[sensor], raw)
    return replace(obs, zero_scatter=scatter)
