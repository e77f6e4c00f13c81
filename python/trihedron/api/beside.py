"""Diagnose with a reference: the diagnosis by poses and moves, extended by the fit to known motion."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from trihedron.api.calibrating import calibrate
from trihedron.api.choices import gravity_of, settle_gravity
from trihedron.api.reading import read, segment
from trihedron.api.referring import AnyReference, calibration_by, diagnosis_by, effects_of, held_against
from trihedron.api.simulating import names_scenario
from trihedron.errors import INPUT_ERRORS, InputError
from trihedron.estimate.reference.fit import moves_along
from trihedron.estimate.reference.start import poses_at_rest
from trihedron.read.reference.motion import of_recording
from trihedron.records import Calibration, Finding, Recording
from trihedron.records.reference import AgainstReference
from trihedron.records.results import DiagnosisResult
from trihedron.records.words import words
from trihedron.sensor_model import correct
from trihedron.units import AccelerationUnit, RateUnit, rate_to_si

ANOTHER_UNIT = "the log of another unit"
FEWEST_POSES = 9
"""Fewest poses that determine the nine parameters of an accelerometer; with fewer, only the reference is used."""


def beside(
    recording: Recording,
    reference: AnyReference,
    columns: str | None,
    given: Calibration | None,
    place: tuple[float | None, float | None, float | None],
    alpha: float,
    ordinary: Callable[[], DiagnosisResult],
) -> DiagnosisResult:
    """The ordinary diagnosis with the fit to the reference added, or that fit alone where the log has too few poses.

    Raises ``InputError`` as :func:`trihedron.api.referring.held_against`.
    """
    gravity, source, said = settle_gravity(*place, gravity_of(given))
    found = held_against(recording, reference, gravity, columns=columns, given=given)
    segments = segment(recording)
    try:
        resting = poses_at_rest(segments, found.gyroscope, has_own_bias=found.kind == ANOTHER_UNIT)
        if resting < FEWEST_POSES:
            raise InputError(f"{resting} poses are too few for a fit of their own")
        result = ordinary()
    except INPUT_ERRORS as error:
        if found.kind == ANOTHER_UNIT:
            # A difference between two gyros may be of either unit: without poses its origin is unknown.
            found = replace(found, findings=(*found.findings, _shared(found)))
        by_reference = diagnosis_by(found, recording, gravity, given, alpha)
        calibration = (
            calibration_by(found, recording, gravity, source, None) if recording.accelerometer is not None else given
        )
        why = Finding.of("reference-only", why=words("because", sentence=error))  # fmt: skip
        return DiagnosisResult(
            **vars(by_reference),
            findings=(*said, *recording.findings, *found.findings, why),
            gravity_source=source,
            model_is_given=given is not None,
            calibration=calibration,
            updated=calibration,
            reference=found,
            segments=segments,
            recording=recording,
        )
    if found.kind == ANOTHER_UNIT:
        return replace(result, reference=found, findings=(*result.findings, *found.findings, _shared(found)))
    # The reference only adds effects: those found by the poses are kept.
    effects = (*result.effects, *(e for e in effects_of(found) if e.id not in {o.id for o in result.effects}))
    verdict = result.verdict
    if len(effects) > len(result.effects) and verdict in ("consistent", "parameters-differ", "not-testable"):
        verdict = "missing-physics"
    return replace(
        result, verdict=verdict, effects=effects, reference=found, findings=(*result.findings, *found.findings)
    )


def in_si(log: Recording, gravity: float | None) -> Recording:
    """The log itself where its gyro is in rad/s or deg/s; a log in counts by its own calibration.

    Raises ``InputError`` when it is in counts and its poses do not determine a calibration.
    """
    if rate_to_si(log.gyroscope_unit) is not None:
        return log
    own = calibrate(log, gravity_m_s2=gravity).calibration
    if own.gyroscope is None or log.gyroscope is None or log.accelerometer is None:
        raise InputError(f"{log.source}: counts of unknown scale.")
    return replace(
        log,
        gyroscope=correct(log.gyroscope, own.gyroscope.S, own.gyroscope.b),
        gyroscope_unit=RateUnit.RAD_S,
        accelerometer=correct(log.accelerometer, own.accelerometer.S, own.accelerometer.b),
        accelerometer_unit=AccelerationUnit.M_S2,
    )


def shared_log(recording: Recording, other: Any, gravity: float | None) -> Recording | None:
    """The given log in SI where it shares the motion of this one (a replay, two units on one beam), else ``None``.

    Two sessions of one protocol share no motion sample by sample: their rates correlate no more than those of unrelated
    hand motions.
    """
    if isinstance(other, str | os.PathLike):
        if names_scenario(other):
            return None
        other = read(other)
    if not isinstance(other, Recording) or other.gyroscope is None or recording.gyroscope is None:
        return None
    try:
        known = in_si(other, gravity)
        moves_along(recording, of_recording(known))
    except INPUT_ERRORS:
        return None
    return known


def _shared(found: AgainstReference) -> Finding:
    offset, sigma = found.clock_offset_s
    return Finding.of(
        "shared-motion",
        correlation=found.correlation,
        offset_s=offset,
        offset_std_s=sigma,
        rate_rms=found.gyroscope.rms,
        has_force=found.accelerometer is not None,
        force_rms=0.0 if found.accelerometer is None else found.accelerometer.rms,
    )
