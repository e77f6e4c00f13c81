"""Empirical relations of what no mechanism explains, in words: variables, share, and what would confirm them."""

from __future__ import annotations

from trihedron.records.diagnosis import Diagnosis, Relation
from trihedron.report.document import Block, Facts
from trihedron.report.numbers import listed, plain_number, unit_in_print, with_sigma

MOST_COEFFICIENTS = 6


def relations_blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    """One block per empirical relation; none where nothing predicts."""
    return tuple(Facts(_rows(one)) for one in diagnosis.relations)


def _rows(relation: Relation) -> tuple[tuple[str, str], ...]:
    shown = relation.coefficients[:MOST_COEFFICIENTS]
    words = [f"{c.name} {_value(c.value, c.std)} {unit_in_print(c.unit)}" for c in shown]
    more = len(relation.coefficients) - len(shown)
    rows = [
        ("empirical relation", relation.statement),
        ("", f"{relation.form}: " + ", ".join(words) + (f", {more} more" if more > 0 else "")),
    ]
    if relation.resembles:
        rows.append(("", f"Similar to {listed(list(relation.resembles))}; similarity is no proof."))
    if relation.experiment:
        rows.append(("", f"To confirm it: {relation.experiment}."))
    return tuple(rows)


def _value(value: float, sigma: float) -> str:
    return with_sigma(value, sigma) if sigma > 0.0 else plain_number(value, 3)
