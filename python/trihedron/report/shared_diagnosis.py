"""Report of several recordings of one unit, diagnosed together."""

from typing import Any

from trihedron.records.diagnosis import SharedDiagnosis, SharedEffect
from trihedron.records.recording import as_arguments, distinct_names
from trihedron.report.diagnosis_words import (
    level_of,
    p_in_words,
    parameter_unit,
    serious_beside,
    value_in_words,
    verdict_in_words,
)
from trihedron.report.document import Block, Document, Facts, Paragraph, Section, Table
from trihedron.report.findings import findings_block
from trihedron.report.findings.wording import opening
from trihedron.report.names import id_in_print, ids_in_print, parameter_in_print
from trihedron.report.numbers import capital, listed, plain_number

LONGEST = 16
"""Most letters of a name beside its row; recordings with longer names are numbered, as in the title."""


def shared_diagnosis_report(found: SharedDiagnosis) -> Document:
    """Lay out shared effects, and effects of single recordings."""
    names = distinct_names([one.recording_source for one in found.diagnoses])
    own = [one.id for one in found.effects if one.is_of_instrument]
    owner = "design" if found.findings else "instrument"
    verdict = "The recordings share no missing effect."
    if own:
        verb = "is missing from the model and belongs" if len(own) == 1 else "are missing from the model and belong"
        verdict = f"{ids_in_print(own)} {verb} to the {owner}: one size fits all recordings."
    elif found.effects:
        verdict = f"{ids_in_print(one.id for one in found.effects)} differs from recording to recording."
    tried = tuple((id_in_print(one.id), plain_number(one.score)) for one in found.candidates)
    alone = {name: ids for name, ids in zip(names, found.of_single_recordings, strict=True) if ids}
    doubted = _doubted(found, names)
    wrong = [f"{name} by itself is NOT TO BE TRUSTED: {why}." for name, why in doubted.items()]
    verdict = capital(verdict)
    if alone:
        missing = [f"{name} by itself misses {ids_in_print(ids)}" for name, ids in alone.items()]
        wrong.append(f"MISSING PHYSICS: {'; '.join(missing)}.")
    if not (wrong or found.effects):
        wrong.append("CONSISTENT: no recording misses an effect by itself.")
    if found.findings:
        wrong.insert(0, "The recordings look like those of different units: their axes or scales differ.")
    return Document(
        title="Diagnosis of several recordings",
        subtitle=", ".join(names),
        verdict=" ".join([*wrong, verdict]),
        sections=(
            Section("Effects that all recordings share", _effects(found, names)),
            Section("Each recording by itself", (_each(found, names),)),
            *((Section("Findings", (findings_block(found.findings),)),) if found.findings else ()),
            Section("Candidates", (Table(("effect", "score together"), tried, "The catalogue"),)),
        ),
        stated_level="bad" if doubted else "usable" if found.effects or alone else "good",
        next_step=_next_step(found, own, list(doubted)),
    )


def _doubted(found: SharedDiagnosis, names: list[str]) -> dict[str, str]:
    """Recordings that are red by themselves, each with the reason."""
    unexplained = "neither the model nor a known effect explains it"
    out = {name: unexplained for name, one in zip(names, found.diagnoses, strict=True) if level_of(one) == "bad"}
    for name, one, own in zip(names, found.diagnoses, found.calibrations, strict=False):
        if serious := serious_beside(one, own):
            out[name] = opening(serious.seen)
    return out


def _next_step(found: SharedDiagnosis, own: list[str], doubted: list[str]) -> str:
    if doubted:
        return f"Leave out {listed(doubted)}, or record again, and diagnose the recordings together then."
    if found.findings:
        return found.findings[0].action
    if own:
        return (
            "Store it with the calibration of one recording: `trihedron calibrate LOG --extended -o calibration.json`."
        )
    pairs = zip(found.diagnoses, found.of_single_recordings, strict=True)
    if alone := [f"`trihedron diagnose {as_arguments(one.recording_source)}`" for one, ids in pairs if ids]:
        return (
            f"What a recording misses alone belongs to its session: {listed(alone)}; or to another unit: `calibrate` "
            "with all of them shows where S differs."
        )
    return "Nothing is to be added. Calibrate them together: `calibrate` in place of `diagnose`."


def _effects(found: SharedDiagnosis, names: list[str]) -> tuple[Block, ...]:
    if not found.effects:
        return (Paragraph("No effect of the catalogue gains with one size in all recordings."),)
    blocks: list[Block] = []
    for k, effect in enumerate(found.effects):
        alone = ", ".join(plain_number(score) for score in effect.scores)
        scores = f"score {plain_number(effect.score)} together; {alone} in each"
        facts = Facts(((f"{k + 1}. {id_in_print(effect.id)}", scores), ("", _agreement(effect))))
        blocks += [facts, _parameters(effect, names)]
    return tuple(blocks)


def _agreement(effect: SharedEffect) -> str:
    p = p_in_words(effect.p_agree)
    if effect.is_of_instrument:
        return f"Its values agree between recordings (p {p}): one size fits all recordings."
    return f"Its values differ between recordings (p {p}): it belongs to the single recordings, or another effect does."


def _parameters(effect: SharedEffect, names: list[str]) -> Table:
    rows = []
    for i, common in enumerate(effect.parameters):
        largest = max(abs(one[i].value) for one in (effect.parameters, *effect.each))
        scale, unit = parameter_unit(common.unit, largest)
        found = [one[i] for one in (effect.parameters, *effect.each)]
        cells = [value_in_words(scale * one.value, scale * one.std) for one in found]
        rows.append((f"{parameter_in_print(common.name)} [{unit}]", *cells))
    return Table(("parameter", "together", *names), tuple(rows), "Parameters together and alone")


def _each(found: SharedDiagnosis, names: list[str]) -> Table:
    rows = tuple(
        (name, verdict_in_words(one).split(":")[0].lower(), ids_in_print(alone) if alone else "–")
        for name, one, alone in zip(names, found.diagnoses, found.of_single_recordings, strict=True)
    )
    return Table(("recording", "verdict", "named here alone"), rows, "Recordings by themselves")


def shared_diagnosis_record(found: SharedDiagnosis) -> dict[str, Any]:
    """The content of the report as plain types (SI)."""
    return {
        "n_recordings": len(found.diagnoses),
        "effects": [one.to_dict() for one in found.effects],
        "candidates": [one.to_dict() for one in found.candidates],
        "diagnoses": [one.to_dict() for one in found.diagnoses],
    }
