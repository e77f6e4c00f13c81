"""A fitted model of both sensors as the comparison needs it: numbers, their covariance, and how far zeros wander."""

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

    Between SI units the factor is known. Between counts and SI it is not: there the mean scale of the three axes is
    the recording's own, as in the comparison of the numbers, and what is left are the differences between axes.
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
"""A calibration without error bars is taken at its last printed digits: this share of each number."""
LONGEST_CORNER = 0.25
"""Corner times beyond a quarter of the recording are not told from none: a zero may wander as much as that allows.
Over 14 simulated pairs of one unit the accelerometer's differences are then 0.9 to 1.1 of their error bars."""


@dataclass(frozen=True, eq=False)
class FittedModel:
    """S and b of both sensors, direct form, raw → SI.

    ``covariance`` (24, 24), or (12, 12) without a gyro, in the order of a calibration file; ``accel_wander``,
    ``gyro_wander`` (3,) variances [SI²] by which a zero of the instrument frame differs from one session to the next
    for reasons that the fit knows nothing of.
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
    """A calibration as given. How far its zeros wander is not in the file: the recording's own wander stands for it."""
    accel, gyro = calibration.accelerometer, calibration.gyroscope
    covariance = np.array(calibration.covariance, dtype=np.float64)
    if not np.any(covariance):
        numbers = [accel.S.ravel(), accel.b] + ([] if gyro is None else [gyro.S.ravel(), gyro.b])
        covariance = np.diag((PUBLISHED_DIGITS * np.concatenate(numbers)) ** 2)
    return FittedModel(
        accel.S,
        accel.b,
        accel.raw_unit,
        None if gyro is None else gyro.S,
        None if gyro is None else gyro.b,
        "" if gyro is None else gyro.raw_unit,
        covariance,
        np.zeros(3),
        np.zeros(3),
    )


def model_of_diagnosis(diagnosis: Diagnosis, *, with_effects: bool = True) -> FittedModel:
    """The fit of a recording to itself, with the effects accepted in it or without, widened by what is unexplained.

    Wander of a zero between two sessions: twice the floor of its Allan variance, or what the zeros of the poses show
    where that is more (eq. 9.2, 9.3).
    """
    fit = diagnosis.extended if with_effects else diagnosis.baseline
    tests = diagnosis.remaining if with_effects else diagnosis.domains
    if fit.covariance is None:
        raise RefusedError("a diagnosis is compared by its covariance, and this one carries none")
    accel, gyro = fit.accelerometer, fit.gyroscope
    covariance = np.array(fit.covariance)
    widened = np.ones(len(covariance))
    widened[:12] = np.sqrt(_excess(tests, "static-accel"))
    widened[12:21] = np.sqrt(max(_excess(tests, "moves"), _excess(tests, "dynamics")))
    covariance *= np.outer(widened, widened)
    return FittedModel(
        np.array(accel["S"]),
        np.array(accel["b"]),
        str(accel["raw_unit"]),
        None if gyro is None else np.array(gyro["S"]),
        None if gyro is None else np.array(gyro["b"]),
        "" if gyro is None else str(gyro["raw_unit"]),
        covariance,
        _floor(diagnosis, "accelerometer"),
        np.maximum(_floor(diagnosis, "gyroscope"), _scatter_of_mean(diagnosis)),
    )


def _excess(tests: tuple[DomainTest, ...], domain: Domain) -> float:
    """χ² per degree of freedom of what the fit leaves, at least 1 (Birge), whether or not the domain disagrees.

    Sixteen degrees of freedom call nothing below 2 a disagreement: zeros that scatter a little would leave error bars
    a third too short.
    """
    for test in tests:
        if test.domain == domain:
            return max(test.chi2_per_dof, 1.0)
    return 1.0


def _floor(diagnosis: Diagnosis, sensor: str) -> FloatArray:
    """(3,) twice N²/τ, the Allan variance where white noise and walk cross (eq. 9.2)."""
    density, corner = diagnosis.noise.get(f"{sensor}_density"), diagnosis.noise.get(f"{sensor}_corner_s")
    times = [shown.time_after_s for shown in diagnosis.residuals if len(shown.time_after_s)]
    if density is None or not corner or not times:
        return np.zeros(3)
    seen = LONGEST_CORNER * max(float(t[-1] - t[0]) for t in times)
    return 2.0 * np.asarray(density, dtype=np.float64) ** 2 / min(float(corner), max(seen, 1.0))


def _scatter_of_mean(diagnosis: Diagnosis) -> FloatArray:
    """(3,) wander of a session's zero as its own poses show it: what neighbours share stays, what they do not averages.

    ``2 C₁ + (V - C₁)/n``, V the variance of the zeros of n poses beyond their noise, C₁ the covariance of neighbours,
    both pooled over the axes: between two sessions 1/f noise differs by twice what it does within one (eq. 9.3).
    """
    for shown in diagnosis.residuals:
        if shown.domain == "static-gyro" and len(shown.after) > 2:
            n = len(shown.after)
            away = shown.after - shown.after.mean(axis=0)
            total = max(float((away**2).sum()) / (3 * (n - 1)) - float(np.mean(shown.sigma_after**2)), 0.0)
            # Taking the mean off makes neighbours anticorrelated by variance/n: given back.
            shared = float(np.mean(away[1:] * away[:-1])) + float(np.mean(away**2)) / n
            shared = min(max(shared, 0.0), total)
            return np.full(3, 2.0 * shared + (total - shared) / n)
    return np.zeros(3)
