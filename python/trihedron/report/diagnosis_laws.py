"""Laws of what no known mechanism explains, in words: what it depends on, how much of it, what would prove it."""

from __future__ import annotations

from trihedron.records.diagnosis import Diagnosis, Law
from trihedron.report.document import Block, Facts
from trihedron.report.numbers import listed, plain_number, unit_in_print, with_sigma

MOST_COEFFICIENTS = 6


def laws_blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    """One block per empirical relation; none where nothing predicts."""
    return tuple(Facts(_rows(law)) for law in diagnosis.laws)


def _rows(law: Law) -> tuple[tuple[str, str], ...]:
    shown = law.coefficients[:MOST_COEFFICIENTS]
    words = [f"{c.name} {_value(c.value, c.std)} {unit_in_print(c.unit)}" for c in shown]
    more = len(law.coefficients) - len(shown)
    rows = [
        ("empirical relation", law.statement),
        ("", f"{law.form}: " + ", ".join(words) + (f", {more} more" if more > 0 else "")),
    ]
    if law.resembles:
        rows.append(("", f"Similar to {listed(list(law.resembles))}; similarity is no proof."))
    if law.experiment:
        rows.append(("", f"To confirm it: {law.experiment}."))
    return tuple(rows)


def _value(value: float, sigma: float) -> str:
    return with_sigma(value, sigma) if sigma > 0.0 else plain_number(value, 3)
