"""A fitted model of both sensors for the comparison: S and b, covariance, and variance of the bias between sessions."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.session.starting_point import PUBLISHED_DIGITS
from trihedron.errors import InputError
from trihedron.estimate.sessions.changes import between_sessions
from trihedron.invariants import invariants, jacobian
from trihedron.records import Calibration, SensorCalibration
from trihedron.records.diagnosis import Diagnosis
from trihedron.records.domains import Domain
from trihedron.units import si_of


def as_read(given: Calibration, recording: FittedModel) -> Calibration:
    """``given`` with S per unit of the recording's readings.

    Between SI units the factor is known. Between counts and SI it is not: the mean scale of the three axes is then
    taken from the recording, as in the comparison of parameters, and only differences between axes remain.
    """
    gyroscope = given.gyroscope
    if gyroscope is not None and recording.gyroscope is not None:
        gyroscope = _scaled(gyroscope, recording.gyroscope)
    return replace(given, accelerometer=_scaled(given.accelerometer, recording.accelerometer), gyroscope=gyroscope)


def _scaled(given: SensorCalibration, own: FittedSensor) -> SensorCalibration:
    before, after = si_of(given.raw_unit), own.si
    if given.raw_unit == own.unit:
        return given
    if before is not None and after is not None:
        factor = after / before
    else:
        mean = [float(invariants(S, given.b).log_scale.mean()) for S in (given.S, own.S)]
        factor = math.exp(mean[0] - mean[1])
    return replace(given, S=factor * given.S)


LONGEST_CORNER = 0.25
"""Share of the recording above which a corner time is not distinguished from none: the bias may walk by as much. In 14
simulated pairs of one unit accelerometer differences are 0.9 to 1.1 of their uncertainty."""

OWN_DOMAINS: tuple[frozenset[Domain], frozenset[Domain]] = (
    frozenset({"static-accel"}),
    frozenset({"static-gyro", "moves"}),
)
"""Domains that determine S and b of the accelerometer and of the gyro."""


@dataclass(frozen=True, eq=False)
class FittedSensor:
    """S and b of one sensor, direct form, raw → SI; ``drift`` (3,) is the variance [SI²] of the bias change from one
    session to the next in the body frame, which the covariance does not contain."""

    S: FloatArray
    b: FloatArray
    unit: str
    drift: FloatArray = field(default_factory=lambda: np.zeros(3))

    @property
    def si(self) -> float | None:
        """SI per reading, where its unit states it."""
        return si_of(self.unit)

    def spread(self, covariance: FloatArray) -> FloatArray:
        """(9, 9) covariance of the invariants, from that (12, 12) of S and b."""
        J = jacobian(self.S, self.b)
        return np.asarray(J @ covariance @ J.T)


@dataclass(frozen=True, eq=False)
class FittedModel:
    """Both sensors; ``covariance`` (24, 24), or (12, 12) without a gyro, in the order of a calibration file."""

    accelerometer: FittedSensor
    gyroscope: FittedSensor | None
    covariance: FloatArray


def model_of_calibration(calibration: Calibration) -> FittedModel:
    """A calibration as given. It contains no bias change between sessions: the comparison uses the recording's."""
    both = [one for one in (calibration.accelerometer, calibration.gyroscope) if one is not None]
    covariance = np.array(calibration.covariance, dtype=np.float64)
    if not np.any(covariance):
        numbers = np.concatenate([part.ravel() for one in both for part in (one.S, one.b)])
        covariance = np.diag((PUBLISHED_DIGITS * numbers) ** 2)
    accelerometer, *gyroscope = (FittedSensor(one.S, one.b, one.raw_unit) for one in both)
    return FittedModel(accelerometer, gyroscope[0] if gyroscope else None, covariance)


def model_of_diagnosis(diagnosis: Diagnosis, *, with_effects: bool = True) -> FittedModel:
    """The fit of a recording, with its accepted effects or without, its gyro axes in the sense of the accelerometer's.

    Bias change between two sessions: twice the floor of the Allan variance, or what the biases of the poses show
    where that is more (eq. 9.2, 9.3). Misfit of a sensor's own domains that stays unexplained is no noise that the fit
    averages out: the sensor's covariance is multiplied by it (Birge's ratio).
    """
    fit = diagnosis.extended if with_effects else diagnosis.baseline
    if fit.covariance is None:
        raise InputError("a diagnosis is compared by its covariance, and this one carries none")
    scale = np.repeat([_unexplained(diagnosis, domains) for domains in OWN_DOMAINS], 12)[: len(fit.covariance)]
    covariance = np.array(fit.covariance) * np.sqrt(np.outer(scale, scale))
    sense = _sense(diagnosis)
    turned = np.concatenate([np.ones(12), np.tile(sense, 3), np.ones(3)])[: len(fit.covariance)]
    covariance *= np.outer(turned, turned)
    of_gyro = np.maximum(_floor(diagnosis, "gyroscope"), _scatter_of_mean(diagnosis))
    accelerometer, gyroscope = (
        None if side is None else FittedSensor(np.array(side["S"]), np.array(side["b"]), str(side["raw_unit"]), drift)
        for side, drift in ((fit.accelerometer, _floor(diagnosis, "accelerometer")), (fit.gyroscope, of_gyro))
    )
    assert accelerometer is not None
    if gyroscope is not None:
        gyroscope = replace(gyroscope, S=gyroscope.S * sense)
    return FittedModel(accelerometer, gyroscope, covariance)


def _sense(diagnosis: Diagnosis) -> FloatArray:
    """(3,) -1 for gyro axes reversed against their documentation: an effect, no other bias or angle."""
    handed = (effect for effect in diagnosis.effects if effect.id == "axis-handedness")
    signs = {p.name: p.value for effect in handed for p in effect.parameters}
    return np.array([signs.get(f"gyro_sign_{axis}", 1.0) for axis in AXES])


def _unexplained(diagnosis: Diagnosis, domains: frozenset[Domain]) -> float:
    """Largest χ² per degree of freedom of ``domains`` that disagree after the effects; at least 1."""
    return max(
        (test.chi2_per_dof for test in diagnosis.remaining if test.disagrees and test.domain in domains), default=1.0
    )


def _floor(diagnosis: Diagnosis, sensor: str) -> FloatArray:
    """(3,) twice N²/τ, the Allan variance where white noise and walk cross (eq. 9.2)."""
    density, corner = diagnosis.noise.get(f"{sensor}_density"), diagnosis.noise.get(f"{sensor}_corner_s")
    times = [shown.time_after_s for shown in diagnosis.residuals if len(shown.time_after_s)]
    if density is None or not corner or not times:
        return np.zeros(3)
    seen = LONGEST_CORNER * max(float(t[-1] - t[0]) for t in times)
    return 2.0 * np.asarray(density, dtype=np.float64) ** 2 / min(float(corner), max(seen, 1.0))


def _scatter_of_mean(diagnosis: Diagnosis) -> FloatArray:
    """(3,) variance of the gyro's bias change between sessions from the biases of the poses, SI²; pooled over axes."""
    for shown in diagnosis.residuals:
        if shown.domain == "static-gyro" and len(shown.after) > 2:
            return np.full(3, between_sessions(shown.after - shown.after.mean(axis=0), shown.sigma_after**2))
    return np.zeros(3)
