"""A log with reference motion: the fit to it as a calibration and as a diagnosis."""

from __future__ import annotations

import os
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from trihedron.api.reading import read
from trihedron.comparison.fitted import FittedModel, FittedSensor, model_of_calibration
from trihedron.comparison.parameters import compare_numbers
from trihedron.errors import InputError
from trihedron.estimate.reference import fit_reference
from trihedron.read import ReadError
from trihedron.read.reference.motion import of_recording, read_reference
from trihedron.records import Calibration, Finding, Frame, Recording, SensorCalibration
from trihedron.records.checked import WrongTypeError
from trihedron.records.diagnosis import (
    AcceptedEffect,
    Candidate,
    Diagnosis,
    EffectParameter,
    LinearModel,
    ParameterDifference,
    Verdict,
)
from trihedron.records.domains import DomainTest
from trihedron.records.reference import NAMED_FROM, AgainstReference, Estimate, ReferenceMotion
from trihedron.sensor_model import in_frame
from trihedron.units import acceleration_to_si

AnyReference = ReferenceMotion | Recording | str | os.PathLike[str]

NOMINAL_SCALE, NOMINAL_BIAS_M_S2 = 0.1, 0.5
"""Standard uncertainties of an uncalibrated accelerometer: scale (10 %, from |g| in static poses) and bias."""


def motion_of(reference: AnyReference, columns: str | None = None) -> ReferenceMotion:
    """A reference from a file of attitude, rate or pose, or from the log of another unit that moved along.

    Raises ``InputError`` with the file and what to do.
    """
    if isinstance(reference, ReferenceMotion):
        return reference
    if isinstance(reference, Recording):
        return of_recording(reference)
    if not isinstance(reference, str | os.PathLike):
        raise WrongTypeError(f"a reference is a file, a recording or a motion, not {type(reference).__name__}.")
    if columns is None:
        try:
            log = read(reference)
        except ReadError:
            return read_reference(reference)
        is_named = not any(f.code == "columns-assumed" for f in log.findings)
        if is_named and log.accelerometer is not None and log.gyroscope is not None:
            return replace(of_recording(log), findings=())
    return read_reference(reference, columns)


def held_against(
    recording: Recording,
    reference: AnyReference,
    gravity: float,
    *,
    columns: str | None = None,
    given: Calibration | None = None,
) -> AgainstReference:
    """Fit a log to a reference; ``given`` is a calibration whose replay is added for comparison.

    Raises ``InputError`` when the two share no time or motion, or the reference does not determine the sensors.
    """
    is_own = not isinstance(reference, ReferenceMotion | Recording) and os.path.abspath(reference) == os.path.abspath(
        recording.source
    )
    motion = read_reference(reference, columns) if is_own else motion_of(reference, columns)  # type: ignore[arg-type]
    known = None if given is None or given.gyroscope is None else (given.gyroscope.S, given.gyroscope.b)
    found = fit_reference(recording, motion, gravity, given=known)
    if is_own or (motion.sha256 and motion.sha256 == recording.sha256):
        found = replace(found, findings=(*found.findings, Finding.of("reference-of-itself")))
    return found


def calibration_by(
    found: AgainstReference, recording: Recording, gravity: float, source: str, frame: Frame | None
) -> Calibration:
    """Both sensors from the reference, in the lower-triangular frame, or (``case``) in the reference's body.

    Raises ``InputError`` when the log has no accelerometer: a calibration file needs both.
    """
    if recording.accelerometer is None:
        raise InputError(
            f"{recording.source}: a calibration contains an accelerometer too, and this log has none; "
            "`trihedron diagnose LOG --reference MOTION --json FILE` writes the gyro's parameters."
        )
    fitted, gyroscope = _sensors(found, recording, f"reference ({found.kind})")
    findings: tuple[Finding, ...] = (*recording.findings, *found.findings)
    wanted: Frame = frame or "lower"
    if fitted is not None:
        accelerometer = fitted
    else:
        accelerometer, finding = _nominal(recording, gravity)
        findings, wanted = (*findings, finding), "case"
    covariance = np.zeros((24, 24))
    covariance[:12, :12], covariance[12:, 12:] = accelerometer.covariance, gyroscope.covariance
    covariance[:12, 12:], covariance[12:, :12] = found.cross_covariance, found.cross_covariance.T
    calibration = Calibration(
        accelerometer, gyroscope, covariance, "case", gravity, source, recording.source, recording.sha256, findings
    )
    return in_frame(calibration, wanted)


def _nominal(recording: Recording, gravity: float) -> tuple[SensorCalibration, Finding]:
    """An uncalibrated accelerometer of nominal scale, with correspondingly large uncertainties."""
    raw = recording.accelerometer
    assert raw is not None
    scale = acceleration_to_si(recording.accelerometer_unit)
    if scale is None:
        scale = gravity / float(np.nanmedian(np.linalg.norm(raw, axis=1)))
    covariance = np.diag([*np.full(9, (NOMINAL_SCALE * scale) ** 2), *np.full(3, NOMINAL_BIAS_M_S2**2)])
    finding = Finding.of("accelerometer-nominal", scale=scale)
    unit = recording.accelerometer_unit.value
    return SensorCalibration(scale * np.eye(3), np.zeros(3), covariance, unit, "m/s^2", "nominal"), finding


def effects_of(found: AgainstReference) -> tuple[AcceptedEffect, ...]:
    """Effects with a score above ``NAMED_FROM``, the highest first (the Bayes factor bounds p)."""
    named = [(one.score or 0.0, ident, one) for ident, one in found.effects.items()]
    return tuple(_accepted(ident, one) for score, ident, one in sorted(named, reverse=True) if score > NAMED_FROM)


def _accepted(ident: str, one: Estimate) -> AcceptedEffect:
    assert one.score is not None
    units = one.unit.split(", ")
    per = len(one.names) // len(units)
    is_g = ident == "gyro-g-sensitivity"
    names = [f"G_{name}" if is_g else name.replace(" ", "_") for name in one.names]
    parameters = tuple(
        EffectParameter(name, float(v), float(s), units[min(k // per, len(units) - 1)])
        for k, (name, v, s) in enumerate(zip(names, one.value, one.std, strict=True))
    )
    largest = int(np.argmax(np.abs(one.value / one.std)))
    what = "reads a rate that follows specific force" if is_g else "has a scale that depends on rate"
    return AcceptedEffect(
        ident,
        f"The gyro {what} ({parameters[largest].name} stands out most).",
        parameters,
        float(np.exp(-0.5 * one.score)),
        -one.score,
        (),
        # Stated in the reference's body: the unit may be mounted differently in another recording.
        model=MappingProxyType(
            {
                "variant": "both" if ident == "gyro-scale-nonlinearity" else "",
                "shape": {},
                "values": [float(v) for v in one.value],
                "applies_to_other_recordings": False,
            }
        ),
    )


def parameters_of(found: AgainstReference, given: Calibration, alpha: float) -> tuple[ParameterDifference, ...]:
    """Parameters of a given calibration compared with those from the reference."""
    model = model_of_calibration(given)
    fit, force = found.gyroscope, found.accelerometer
    covariance = np.zeros((24, 24))
    covariance[12:, 12:] = fit.covariance
    covariance[:12, :12] = model.covariance[:12, :12] if force is None else force.covariance
    # The day-to-day change of the biases is unknown here: only the uncertainty of the fit is used.
    own = model.accelerometer
    accelerometer = own if force is None else replace(own, S=force.S, b=force.b)
    unit = "counts" if model.gyroscope is None else model.gyroscope.unit
    seen = FittedModel(accelerometer, FittedSensor(fit.S, fit.b, unit), covariance)
    numbers = compare_numbers(model, seen, alpha=alpha).parameters
    return tuple(p for p in numbers if force is not None or p.sensor == "gyroscope")


def diagnosis_by(
    found: AgainstReference, recording: Recording, gravity: float, given: Calibration | None, alpha: float
) -> Diagnosis:
    """A diagnosis by the reference alone, for a log with too few poses."""
    effects = effects_of(found)
    parameters = () if given is None or given.gyroscope is None else parameters_of(found, given, alpha)
    test = _rate(found)
    left = replace(test, disagrees=False) if effects else test
    differ = any(p.significant for p in parameters)
    verdict: Verdict = "missing-physics" if effects else "parameters-differ" if differ else "consistent"
    nothing = SensorCalibration(np.zeros((3, 3)), np.zeros(3), np.zeros((12, 12)), "none", "m/s^2", "none")
    force, gyro = _sensors(found, recording, "reference")
    linear = LinearModel.of_sensors(force or nothing, gyro)
    return Diagnosis(
        verdict=verdict,
        domains=(test,),
        effects=effects,
        remaining=(left,),
        candidates=tuple(
            Candidate(name, float(np.exp(-0.5 * max(one.score or 0.0, 0.0))), True, score=one.score)
            for name, one in found.effects.items()
        ),
        baseline=linear,
        extended=linear,
        noise=MappingProxyType({}),
        gravity_m_s2=gravity,
        alpha=alpha,
        recording_source=recording.source,
        recording_sha256=recording.sha256,
        parameters=parameters,
    )


def _rate(found: AgainstReference) -> DomainTest:
    """Test of the rate during the motion; p from the best score of the effects, corrected for multiple testing."""
    score = max([0.0, *(one.score or 0.0 for one in found.effects.values())])
    return DomainTest(
        "rate", 1.0, float(3 * found.gyroscope.n_rows), float(np.exp(-0.5 * score)), score > NAMED_FROM,
        rms=found.gyroscope.rms, unit="rad/s",
    )  # fmt: skip


def _sensors(
    found: AgainstReference, recording: Recording, method: str
) -> tuple[SensorCalibration | None, SensorCalibration]:
    """Both sensors as they were fitted; the accelerometer where the reference determines it."""
    gyro, force = found.gyroscope, found.accelerometer
    rate_unit, unit = recording.gyroscope_unit.value, recording.accelerometer_unit.value
    return (
        None if force is None else SensorCalibration(force.S, force.b, force.covariance, unit, "m/s^2", method),
        SensorCalibration(gyro.S, gyro.b, gyro.covariance, rate_unit, "rad/s", method),
    )
