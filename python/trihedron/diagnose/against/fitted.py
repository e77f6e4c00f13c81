"""A fitted model of both sensors for the comparison: S and b, covariance, and variance of the bias between sessions."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError
from trihedron.invariants import invariants
from trihedron.records import Calibration, SensorCalibration
from trihedron.records.diagnosis import Diagnosis
from trihedron.records.domains import Domain, DomainTest
from trihedron.units import AccelerationUnit, RateUnit, acceleration_to_si, rate_to_si


def as_read(given: Calibration, recording: FittedModel) -> Calibration:
    """``given`` with S per unit of the recording's readings.

    Between SI units the factor is known. Between counts and SI it is not: the mean scale of the three axes is then
    taken from the recording, as in the comparison of parameters, and only differences between axes remain.
    """
    a, g = given.accelerometer, given.gyroscope
    units = acceleration_to_si(AccelerationUnit(a.raw_unit)), acceleration_to_si(AccelerationUnit(recording.accel_unit))
    accelerometer = _scaled(a, recording.accel_S, recording.accel_unit, units)
    if g is None or recording.gyro_S is None:
        return replace(given, accelerometer=accelerometer)
    units = rate_to_si(RateUnit(g.raw_unit)), rate_to_si(RateUnit(recording.gyro_unit))
    return replace(
        given, accelerometer=accelerometer, gyroscope=_scaled(g, recording.gyro_S, recording.gyro_unit, units)
    )


def _scaled(
    given: SensorCalibration, own_S: FloatArray, unit: str, units: tuple[float | None, float | None]
) -> SensorCalibration:
    if given.raw_unit == unit:
        return given
    before, after = units
    if before is not None and after is not None:
        factor = after / before
    else:
        mean = [float(invariants(S, given.b).log_scale.mean()) for S in (given.S, own_S)]
        factor = math.exp(mean[0] - mean[1])
    return replace(given, S=factor * given.S)


PUBLISHED_DIGITS = 1e-6
"""Relative standard uncertainty of a calibration without a covariance: its last printed digits."""
LONGEST_CORNER = 0.25
"""Share of the recording above which a corner time is not distinguished from none: the bias may walk by as much. In 14
simulated pairs of one unit accelerometer differences are 0.9 to 1.1 of their uncertainty."""


@dataclass(frozen=True, eq=False)
class FittedModel:
    """S and b of both sensors, direct form, raw → SI.

    ``covariance`` (24, 24), or (12, 12) without a gyro, in the order of a calibration file; ``accel_bias_drift``,
    ``gyro_bias_drift`` (3,) variances [SI²] of the bias change from one session to the next in the body frame, which
    the covariance does not contain.
    """

    accel_S: FloatArray
    accel_b: FloatArray
    accel_unit: str
    gyro_S: FloatArray | None
    gyro_b: FloatArray | None
    gyro_unit: str
    covariance: FloatArray
    accel_bias_drift: FloatArray
    gyro_bias_drift: FloatArray


def model_of_calibration(calibration: Calibration) -> FittedModel:
    """A calibration as given. It contains no bias change between sessions: the comparison uses the recording's."""
    accel, gyro = calibration.accelerometer, calibration.gyroscope
    S_w, b_w, unit_w = (None, None, "") if gyro is None else (gyro.S, gyro.b, gyro.raw_unit)
    covariance = np.array(calibration.covariance, dtype=np.float64)
    if not np.any(covariance):
        numbers = [accel.S.ravel(), accel.b] + ([] if gyro is None else [gyro.S.ravel(), gyro.b])
        covariance = np.diag((PUBLISHED_DIGITS * np.concatenate(numbers)) ** 2)
    nothing = np.zeros(3)
    return FittedModel(accel.S, accel.b, accel.raw_unit, S_w, b_w, unit_w, covariance, nothing, nothing)


def model_of_diagnosis(diagnosis: Diagnosis, *, with_effects: bool = True) -> FittedModel:
    """The fit of a recording, with its accepted effects or without, its covariance widened by the remaining misfit.

    Bias change between two sessions: twice the floor of the Allan variance, or what the biases of the poses show
    where that is more (eq. 9.2, 9.3).
    """
    fit = diagnosis.extended if with_effects else diagnosis.baseline
    tests = diagnosis.remaining if with_effects else diagnosis.domains
    if fit.covariance is None:
        raise RefusedError("a diagnosis is compared by its covariance, and this one carries none")
    (S_f, b_f, unit_f), (S_w, b_w, unit_w) = (
        (None, None, "") if side is None else (np.array(side["S"]), np.array(side["b"]), str(side["raw_unit"]))
        for side in (fit.accelerometer, fit.gyroscope)
    )
    assert S_f is not None
    assert b_f is not None
    covariance = np.array(fit.covariance)
    widened = np.ones(len(covariance))
    widened[:12] = np.sqrt(_excess(tests, "static-accel"))
    widened[12:21] = np.sqrt(max(_excess(tests, "moves"), _excess(tests, "dynamics")))
    covariance *= np.outer(widened, widened)
    of_gyro = np.maximum(_floor(diagnosis, "gyroscope"), _scatter_of_mean(diagnosis))
    of_accel = _floor(diagnosis, "accelerometer")
    return FittedModel(S_f, b_f, unit_f, S_w, b_w, unit_w, covariance, of_accel, of_gyro)


def _excess(tests: tuple[DomainTest, ...], domain: Domain) -> float:
    """χ² per degree of freedom of the remaining misfit, at least 1 (Birge), whether or not the domain disagrees.

    With sixteen degrees of freedom only values above 2 count as disagreement: small bias scatter would make the
    uncertainties a third too small.
    """
    return next((max(test.chi2_per_dof, 1.0) for test in tests if test.domain == domain), 1.0)


def _floor(diagnosis: Diagnosis, sensor: str) -> FloatArray:
    """(3,) twice N²/τ, the Allan variance where white noise and walk cross (eq. 9.2)."""
    density, corner = diagnosis.noise.get(f"{sensor}_density"), diagnosis.noise.get(f"{sensor}_corner_s")
    times = [shown.time_after_s for shown in diagnosis.residuals if len(shown.time_after_s)]
    if density is None or not corner or not times:
        return np.zeros(3)
    seen = LONGEST_CORNER * max(float(t[-1] - t[0]) for t in times)
    return 2.0 * np.asarray(density, dtype=np.float64) ** 2 / min(float(corner), max(seen, 1.0))


def _scatter_of_mean(diagnosis: Diagnosis) -> FloatArray:
    """(3,) variance of the bias change between sessions from the biases of the poses, SI².

    ``2 C₁ + (V - C₁)/n``, V the variance of the biases of n poses beyond their noise, C₁ the covariance of neighbours,
    both pooled over the axes: between two sessions 1/f noise differs by twice its variance within one (eq. 9.3).
    """
    for shown in diagnosis.residuals:
        if shown.domain == "static-gyro" and len(shown.after) > 2:
            n = len(shown.after)
            away = shown.after - shown.after.mean(axis=0)
            total = max(float((away**2).sum()) / (3 * (n - 1)) - float(np.mean(shown.sigma_after**2)), 0.0)
            # Subtracting the mean makes neighbours anticorrelated by variance/n, which is added back.
            shared = float(np.mean(away[1:] * away[:-1])) + float(np.mean(away**2)) / n
            shared = min(max(shared, 0.0), total)
            return np.full(3, 2.0 * shared + (total - shared) / n)
    return np.zeros(3)
