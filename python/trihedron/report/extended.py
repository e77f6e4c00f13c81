"""The report of a calibration with what else its result has: a reference, and effects fitted together with S and b."""

from dataclasses import replace

from trihedron.records.diagnosis import Diagnosis
from trihedron.records.published import HELD_OUT
from trihedron.records.results import CalibrationResult
from trihedron.report.calibration import StatedError, calibration_report, errors_of
from trihedron.report.diagnosis import effect_pictures, effects_blocks, worst_picture
from trihedron.report.document import Document, Section
from trihedron.report.names import MEANING
from trihedron.report.numbers import listed, plain_number, shown, with_unit
from trihedron.report.reference import beside_reference, errors_beside

NEXT = (
    "Test the calibration on another recording: `trihedron verify FILE OTHER_LOG`. Use it: "
    "`trihedron apply FILE LOG -o corrected.csv`; of what `trihedron export` writes, few formats hold the effects."
)


def calibration_result_report(result: CalibrationResult) -> Document:
    """The report of a calibration, with the sections on its reference and on its effects where it has them."""
    beside = errors_beside((result.reference,) if result.reference else ())
    document = calibration_report(result.calibration, result.segments, result.recording, beside)
    document = beside_reference(document, result.reference, 1)
    return document if result.diagnosis is None else _with_effects(document, result.diagnosis)


def _with_effects(document: Document, diagnosis: Diagnosis) -> Document:
    """The report with the worst residual, without and with the effects, as its lead, every effect after the result."""
    effects = Section("Effects fitted with S and b", (*effects_blocks(diagnosis), *effect_pictures(diagnosis)))
    errors = listed([f"{one.what} {with_unit(one.value, one.unit)} ({one.beside})" for one in _errors(diagnosis)])
    predicted = f" Errors over all poses and moves, {HELD_OUT} with the effects: {errors}." if errors else ""
    return replace(
        document,
        verdict=document.verdict + predicted,
        next_step=NEXT if document.next_step else "",
        sections=(document.sections[0], effects, *document.sections[1:]),
        lead=worst_picture(diagnosis),
    )


def _errors(diagnosis: Diagnosis) -> list[StatedError]:
    """Cross-validated errors with the effects, beside those of the S and b that a calibration without them saves."""
    own = getattr(diagnosis, "calibration", None)
    known = () if own is None else errors_of(own)
    alone = {line.what: f"S and b alone {with_unit(line.value, line.unit)}" for line, _, is_held in known if is_held}
    found = []
    for linear, one in diagnosis.predicted:
        factor, unit = shown(one.unit)
        without = f"without them {with_unit(plain_number(factor * linear.rms), unit)}"
        beside = alone.get(MEANING[one.domain], without)
        found.append(StatedError(MEANING[one.domain], plain_number(factor * one.rms), unit, beside))
    return found
