"""Several recordings of one unit, diagnosed together, as a report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from trihedron.records.diagnosis import EffectParameter
from trihedron.records.shared_effects import SharedDiagnosis, SharedEffect
from trihedron.report.diagnosis_words import p_in_words, printed_unit, value_in_words, verdict_in_words
from trihedron.report.document import Block, Document, Facts, Paragraph, Section, Table
from trihedron.report.numbers import engineering_exponent, listed, plain_number, power_of_ten


def shared_diagnosis_report(found: SharedDiagnosis) -> Document:
    """Lay out what recordings share, and what belongs to one of them."""
    names = [Path(one.recording_source.split(" + ")[0]).stem for one in found.diagnoses]
    own = [one.id for one in found.effects if one.is_of_instrument]
    verdict = f"{listed(own)} belongs to the instrument." if own else "The recordings share no missing effect."
    if len(own) > 1:
        verdict = f"{listed(own)} belong to the instrument."
    return Document(
        title="Diagnosis of several recordings",
        subtitle=", ".join(names),
        verdict=verdict,
        is_trustworthy=not found.effects,
        sections=(
            Section("Effects that all recordings share", _effects(found, names)),
            Section("Each recording by itself", (_each(found, names),)),
            Section(
                "Candidates",
                (Table(("effect", "score together"), _candidates(found), "The catalogue"),),
            ),
        ),
        stated_level="usable" if found.effects else "good",
    )


def _effects(found: SharedDiagnosis, names: list[str]) -> tuple[Block, ...]:
    if not found.effects:
        return (Paragraph("No effect of the catalogue gains with one size in all recordings."),)
    blocks: list[Block] = []
    for k, effect in enumerate(found.effects):
        alone = ", ".join(plain_number(score) for score in effect.scores)
        blocks.append(
            Facts(
                (
                    (f"{k + 1}. {effect.id}", f"score {plain_number(effect.score)} together; {alone} in each"),
                    ("", _agreement(effect)),
                )
            )
        )
        blocks.append(_parameters(effect, names))
    return tuple(blocks)


def _agreement(effect: SharedEffect) -> str:
    p = p_in_words(effect.p_agree)
    if effect.is_of_instrument:
        return f"Its values agree between recordings (p {p}): it belongs to the instrument."
    return f"Its values differ between recordings (p {p}): it belongs to the single recordings, or another effect does."


def _parameters(effect: SharedEffect, names: list[str]) -> Table:
    rows = []
    for i, common in enumerate(effect.parameters):
        largest = max(abs(one[i].value) for one in (effect.parameters, *effect.each))
        exponent = engineering_exponent(largest) if largest > 0.0 else 0
        unit = " ".join(word for word in (power_of_ten(exponent), printed_unit(common.unit)) if word)
        cells = [_cell(one[i], 10.0**-exponent) for one in (effect.parameters, *effect.each)]
        rows.append((common.name, *cells, unit))
    return Table(("parameter", "together", *names, "unit"), tuple(rows), "Parameters together and alone")


def _cell(one: EffectParameter, scale: float) -> str:
    return value_in_words(scale * one.value, scale * one.std)


def _each(found: SharedDiagnosis, names: list[str]) -> Table:
    rows = tuple(
        (name, verdict_in_words(one).split(":")[0].lower(), listed(list(alone)) if alone else "–")
        for name, one, alone in zip(names, found.diagnoses, found.of_single_recordings, strict=True)
    )
    return Table(("recording", "verdict", "named here alone"), rows, "Recordings by themselves")


def _candidates(found: SharedDiagnosis) -> tuple[tuple[str, ...], ...]:
    return tuple((one.id, plain_number(one.score)) for one in found.candidates)


def shared_diagnosis_record(found: SharedDiagnosis) -> dict[str, Any]:
    """Everything that the report says, as plain types (SI)."""
    return {
        "n_recordings": len(found.diagnoses),
        "effects": [one.to_dict() for one in found.effects],
        "candidates": [one.to_dict() for one in found.candidates],
        "diagnoses": [one.to_dict() for one in found.diagnoses],
    }
