"""Diagnose with a reference: what poses and moves say, and what known motion beside them adds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from trihedron.pipeline.choices import settle_gravity
from trihedron.pipeline.reading import segment
from trihedron.pipeline.referring import AnyReference, calibration_by, diagnosis_by, effects_of, held_against
from trihedron.pipeline.results import DiagnosisResult
from trihedron.records import Calibration, Finding, FindingCode, Recording, Severity

FEWEST_POSES = 9
"""Nine numbers of an accelerometer need nine poses: with fewer the poses have no model to hold against anything."""


def beside(
    recording: Recording,
    reference: AnyReference,
    columns: str | None,
    given: Calibration | None,
    place: tuple[float | None, float | None, float | None],
    alpha: float,
    ordinary: Callable[[], DiagnosisResult],
) -> DiagnosisResult:
    """The ordinary diagnosis with what known motion says beside it, or that alone where the log holds too few poses.

    Raises
    ------
    ValueError
        As :func:`trihedron.pipeline.referring.held_against`.
    """
    said: tuple[Finding, ...] = ()
    if given is not None and place == (None, None, None):
        gravity, source = given.gravity_m_s2, "that of the calibration"
    else:
        gravity, source, said = settle_gravity(*place)
    found = held_against(recording, reference, gravity, columns=columns, given=given)
    segments = segment(recording)
    try:
        if segments.n_holds < FEWEST_POSES:
            raise ValueError(f"{segments.n_holds} still poses are too few for a model of their own")
        result = ordinary()
    except ValueError as error:
        values = diagnosis_by(found, recording, gravity, given, alpha)
        calibration = (
            calibration_by(found, recording, gravity, source, None) if recording.accelerometer is not None else given
        )
        why = Finding(
            FindingCode.REFERENCE_ONLY, Severity.NOTE,
            f"Only the reference was asked: {str(error).rstrip('.')}.", "The log holds no still poses to speak of.",
        )  # fmt: skip
        return DiagnosisResult(
            **values,
            findings=(*said, *recording.findings, *found.findings, why),
            gravity_source=source,
            model_is_given=given is not None,
            calibration=calibration,
            updated=calibration,
            reference=found,
            segments=segments,
            recording=recording,
        )
    # What the poses found stands; the reference adds what it alone sees, and never takes away.
    effects = (*result.effects, *(e for e in effects_of(found, alpha) if e.id not in {o.id for o in result.effects}))
    verdict = result.verdict
    if len(effects) > len(result.effects) and verdict in ("consistent", "parameters-differ", "not-testable"):
        verdict = "missing-physics"
    return replace(
        result, verdict=verdict, effects=effects, reference=found, findings=(*result.findings, *found.findings)
    )
