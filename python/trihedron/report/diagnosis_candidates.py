"""What a diagnosis tried, as a table: effects accepted, needless, or not applicable."""

from __future__ import annotations

from trihedron.records.diagnosis import Candidate, Diagnosis
from trihedron.report.diagnosis_words import p_in_words
from trihedron.report.document import Table


def candidates_table(diagnosis: Diagnosis) -> Table:
    """Every effect of the catalogue: how far the linear model alone would ask for it, and what became of it."""
    accepted = {effect.id for effect in diagnosis.effects}
    tried = [c for c in diagnosis.candidates if c.applicable]
    tried.sort(key=lambda c: 2.0 if c.p_value is None else c.p_value)
    rows = [
        (
            c.id,
            "–" if c.p_value is None else p_in_words(c.p_value),
            "accepted" if c.id in accepted else _outcome(c),
        )
        for c in tried
    ]
    rows += [(c.id, "–", f"not applicable: {c.reason}") for c in diagnosis.candidates if not c.applicable]
    return Table(("effect", "p against the linear model", "outcome"), tuple(rows), "Every effect of the catalogue")


def _outcome(candidate: Candidate) -> str:
    """Why an effect that was tried is not in the model: small p alone is no reason beside what was accepted."""
    if candidate.stands_against is not None:
        return f"needless beside {candidate.stands_against}"
    return candidate.reason or "not needed"
