"""A diagnosis in tables: S and b without and with the effects, every effect that was tried, empirical relations."""

import numpy as np

from trihedron.arrays import AXES
from trihedron.records.diagnosis import Diagnosis, Relation
from trihedron.report.calibration import shared_power
from trihedron.report.diagnosis_words import parameter_in_words, size_in_words, value_in_words
from trihedron.report.document import Block, Facts, Table
from trihedron.report.names import id_in_print, ids_in_print, variable_in_print
from trihedron.report.numbers import MINUS, listed, one_of, plain_number, unit_in_print, with_sigma

MOST_COEFFICIENTS = 6


def models_blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    blocks: list[Block] = []
    for name in ("accelerometer", "gyroscope"):
        before, after = getattr(diagnosis.baseline, name), getattr(diagnosis.extended, name)
        if before is None or after is None or before["raw_unit"] == "none":
            continue
        # Without an effect both models are equal.
        models = (before, after) if diagnosis.effects else (before,)
        scale, times = shared_power(np.asarray(before["S"]))
        rows = [
            (
                f"S_{AXES[i]}{AXES[j]}{times}",
                *(with_sigma(scale * m["S"][i][j], scale * m["sigma_S"][i][j]) for m in models),
            )
            for i in range(3)
            for j in range(3)
            if before["sigma_S"][i][j] > 0.0
        ]
        rows += [(f"b_{AXES[i]}", *(with_sigma(m["b"][i], m["sigma_b"][i]) for m in models)) for i in range(3)]
        head = ("", "linear model", "with the effects")[: 1 + len(models)]
        raw, si = unit_in_print(before["raw_unit"]), "m/s²" if name == "accelerometer" else "rad/s"
        of_S = "dimensionless" if raw == si else f"in {si} per {one_of(raw)}"
        caption = f"{name.capitalize()}, the reading in {raw}: S {of_S}, b in {si}"
        blocks.append(Table(head, tuple(rows), caption))
    gravity = getattr(diagnosis, "gravity_source", "")
    facts = [("gravity", f"{diagnosis.gravity_m_s2:.5f} m/s²" + (f", {gravity}" if gravity else ""))]
    for name, si in (("accelerometer", "m/s^2"), ("gyroscope", "rad/s")):
        density = diagnosis.noise.get(f"{name}_density")
        if density is not None:
            words = ", ".join(plain_number(float(d)) for d in density)
            words += f" {unit_in_print(str(diagnosis.noise.get(f'{name}_unit', '')))}"
            corner = diagnosis.noise[f"{name}_corner_s"]
            if corner is not None:
                words += f"; the bias random walk dominates beyond {plain_number(float(corner))} s"
            facts.append((f"{name} noise", words))
        changes = diagnosis.noise.get(f"{name}_bias")
        if changes:
            words = f"changes {size_in_words(changes['rms'], si)} RMS between poses (random walk)"
            words += f"; uncertainty of a pose's mean {size_in_words(changes['noise'], si)}"
            facts.append((f"{name} bias", words))
    blocks.append(Facts(tuple(facts)))
    return tuple(blocks)


def candidates_blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    """Every effect of the catalogue: those tried, and the reason for the others."""
    missing: dict[str, list[str]] = {}
    for candidate in diagnosis.candidates:
        if not candidate.applicable:
            missing.setdefault(candidate.reason, []).append(id_in_print(candidate.id))
    rows = tuple((f"not applicable, {reason}", listed(names)) for reason, names in missing.items())
    tried = (candidates_table(diagnosis),) if any(one.applicable for one in diagnosis.candidates) else ()
    return (*tried, *((Facts(rows),) if rows else ()))


def candidates_table(diagnosis: Diagnosis) -> Table:
    """Every effect that was tried: its score, the limit on its size, and the outcome."""
    outcomes = {effect.id: "accepted, as in the model" for effect in getattr(diagnosis, "own_effects", ())}
    outcomes |= {effect.id: "accepted" for effect in diagnosis.effects}
    tried = [c for c in diagnosis.candidates if c.applicable]
    redundant = {c.id: f"redundant with {id_in_print(c.superseded_by)}" for c in tried if c.superseded_by is not None}
    tried.sort(key=lambda c: 2.0 if c.p_value is None else c.p_value)
    rows = [
        (
            id_in_print(c.id),
            "–" if c.score is None else f"{round(c.score, 1) + 0.0:.1f}".replace("-", MINUS),
            "–" if c.limit95 is None or c.id in outcomes else parameter_in_words(c.limit95, c.size[0].unit),
            outcomes.get(c.id) or redundant.get(c.id) or c.reason or "not needed",
        )
        for c in tried
    ]
    caption = "Effects that were tried; score: twice the log-evidence that one gains, corrected for multiple testing"
    return Table(("effect", "score", "at most (95 %)", "outcome"), tuple(rows), caption)


def relation_facts(relation: Relation) -> Facts:
    """An empirical relation with its coefficients, and what would confirm it."""
    shown = relation.coefficients[:MOST_COEFFICIENTS]
    words = [f"{variable_in_print(c.name)} {value_in_words(c.value, c.std)} {unit_in_print(c.unit)}" for c in shown]
    words = [said.removesuffix(" 1") for said in words]
    more = len(relation.coefficients) - len(shown)
    rows = [
        ("empirical relation", relation.statement),
        ("", f"{variable_in_print(relation.form)}: " + ", ".join(words) + (f", {more} more" if more > 0 else "")),
    ]
    if relation.resembles:
        rows.append(("", f"Similar to {ids_in_print(relation.resembles)}; similarity is no proof."))
    if relation.experiment:
        rows.append(("", f"To confirm it: {relation.experiment}."))
    return Facts(tuple(rows))
