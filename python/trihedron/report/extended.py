"""The report of a calibration with what else its result has: a reference, and effects fitted together with S and b."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from trihedron.records.diagnosis import Diagnosis
from trihedron.records.domains import DomainResiduals
from trihedron.records.published import HELD_OUT, IN_SAMPLE
from trihedron.records.results import CalibrationResult
from trihedron.report.calibration import StatedError, calibration_report, errors_of
from trihedron.report.chart import Chart, Panel
from trihedron.report.diagnosis import effect_pictures, effects_blocks, residuals_chart
from trihedron.report.document import Document, Picture, Section
from trihedron.report.names import MEANING, ids_in_print
from trihedron.report.numbers import listed, plain_number, shown, with_unit
from trihedron.report.reference import beside_reference, errors_beside

FIRST = "static-accel"
"""The domain that is always drawn: gravity error in static poses."""
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
    """The report with the residuals without and with the effects as its lead, and every effect after the result."""
    effects = Section("Effects fitted with S and b", (*effects_blocks(diagnosis), *effect_pictures(diagnosis)))
    errors = listed([f"{one.what} {with_unit(one.value, one.unit)} ({one.beside})" for one in _errors(diagnosis)])
    predicted = f" Errors over all poses and moves, {HELD_OUT} with the effects: {errors}." if errors else ""
    return replace(
        document,
        verdict=document.verdict + predicted,
        next_step=NEXT if document.next_step else "",
        sections=(document.sections[0], effects, *document.sections[1:]),
        lead=_changed_picture(diagnosis),
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


def _changed_picture(diagnosis: Diagnosis) -> Picture | None:
    """Residuals without and with the effects: gravity error, and the one in which the strongest effect acts."""
    drawn = {held.domain for effect in diagnosis.effects for held in effect.held_out[:1]} | {FIRST}
    chosen = [one for one in diagnosis.residuals if one.domain in drawn and len(one.before) and len(one.after)]
    if not chosen:
        return None
    caption = f"{listed([MEANING[one.domain] for one in chosen]).capitalize()}, in sample: left by S and b alone, "
    caption += f"right with {ids_in_print(effect.id for effect in diagnosis.effects)}; ± 2 σ of the predicted noise."
    return Picture("effects", caption, partial(_changed_chart, diagnosis, chosen))


def _changed_chart(diagnosis: Diagnosis, chosen: Sequence[DomainResiduals]) -> Chart:
    """A row for every domain: without the effects, with them."""
    panels: list[Panel] = []
    for one in chosen:
        factor, unit = shown(one.unit)
        drawn = residuals_chart(diagnosis, one).panels
        for panel, values in zip(drawn, (one.before, one.after), strict=True):
            rms = float(np.sqrt(np.nanmean(values**2)))
            title = f"{panel.title}, {IN_SAMPLE}: {plain_number(factor * rms)} {unit} rms"
            panels.append(replace(panel, title=title))
    return Chart(tuple(panels), columns=2, is_linked=True)
