"""What a diagnosis tried, as a table: effects accepted, needless, or not applicable."""

from __future__ import annotations

from trihedron.records.diagnosis import Candidate, Diagnosis
from trihedron.report.diagnosis_words import parameter_in_words
from trihedron.report.document import Block, Facts, Table
from trihedron.report.numbers import MINUS, listed


def candidates_blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    """Every effect of the catalogue: what was tried, and why the others could not be."""
    missing: dict[str, list[str]] = {}
    for candidate in diagnosis.candidates:
        if not candidate.applicable:
            missing.setdefault(candidate.reason, []).append(candidate.id)
    rows = tuple((listed(names), f"not applicable: {reason}") for reason, names in missing.items())
    return (candidates_table(diagnosis), Facts(rows)) if rows else (candidates_table(diagnosis),)


def candidates_table(diagnosis: Diagnosis) -> Table:
    """Every effect that was tried: its score, its size at most, and what became of it."""
    accepted = {effect.id for effect in diagnosis.effects}
    tried = sorted((c for c in diagnosis.candidates if c.applicable), key=_order)
    rows = [
        (
            c.id,
            "–" if c.score is None else f"{round(c.score, 1) + 0.0:.1f}".replace("-", MINUS),
            "–" if c.limit95 is None or c.id in accepted else parameter_in_words(c.limit95, c.size[0].unit),
            "accepted" if c.id in accepted else _outcome(c),
        )
        for c in tried
    ]
    caption = "Effects that were tried; score: twice the log-evidence that one gains, less its price"
    return Table(("effect", "score", "at most (95 %)", "outcome"), tuple(rows), caption)


def _order(candidate: Candidate) -> float:
    return 2.0 if candidate.p_value is None else candidate.p_value


def _outcome(candidate: Candidate) -> str:
    """Why an effect that was tried is not in the model: small p alone is no reason beside what was accepted."""
    if candidate.stands_against is not None:
        return f"needless beside {candidate.stands_against}"
    return candidate.reason or "not needed"
