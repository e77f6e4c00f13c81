"""Relations tried beside accepted effects, with columns, priors and penalty alike (docs/relations.md, eq. 11.19)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from trihedron.diagnose.candidates import candidates_beside, with_best
from trihedron.diagnose.effects.contract import Effect
from trihedron.diagnose.hypothesis import Hypothesis, Term, again
from trihedron.diagnose.relations.dependence import Dependence
from trihedron.diagnose.relations.signals import dependences
from trihedron.diagnose.relations.telegraph import TELEGRAPH, telegraphs

MOST_RELATIONS = 3
"""A longer list is no relation that a person would check."""


@dataclass(frozen=True, eq=False)
class Follows:
    """One relation: its term of the hypothesis, its ``score``, and the hypothesis that it was added to."""

    effect: Dependence
    term: Term
    score: float
    before: Hypothesis


@dataclass(frozen=True, eq=False)
class Related:
    """The hypothesis with all its relations; ``score`` is twice the log-evidence of the whole, less the penalties of
    its terms."""

    model: Hypothesis
    relations: tuple[Follows, ...]
    score: float


def related(model: Hypothesis, limit: float, begin: Sequence[Follows] | None = None) -> Related:
    """Relations added to a hypothesis one at a time while the best scores more than ``limit``; beside those of another
    hypothesis, ``begin``, one more."""
    found, terms = [one for one in begin or () if one.effect.family != TELEGRAPH], model.terms
    known, most = {one.effect.id for one in found}, MOST_RELATIONS if begin is None else len(found) + 1
    if found:
        model = again(model, [*terms, *(one.term for one in found)])
    while len(found) < most and model.context.moves:
        best = max(_leading(model, known, limit), key=lambda one: one.score, default=None)
        if best is None or best.score <= limit:
            break
        # The same variable under another prior takes the place of what it was.
        found = [*(one for one in found if one.effect.names != best.effect.names), best]
        known.add(best.effect.id)
        model = again(model, [*terms, *(one.term for one in found)])
    return Related(model, tuple(found), 2.0 * model.log_evidence - sum(term.cost for term in model.terms))


def _leading(model: Hypothesis, known: set[str], limit: float) -> list[Follows]:
    """The relation of most evidence, if it predicts what is held out; random telegraph signals by their own score."""
    every: dict[str, Dependence] = {one.id: one for one in dependences(model.context)}
    out = []
    tried = candidates_beside(model, list[Effect](every.values()), known)
    standing = [one for one in tried if one.score > limit]
    larger, term = with_best(model, standing) if standing else (model, None)
    if term is not None and larger.is_shown(model, len(model.terms)):
        score = 2.0 * (larger.log_evidence - model.log_evidence) - term.cost
        out.append(Follows(every[term.effect.id], term, score, model))
    for effect, score in telegraphs(model.context):
        if effect.id not in known:
            (variant,) = effect.variants(model.context)
            out.append(Follows(effect, Term(effect, variant, effect.sizes(model.context, variant)), score, model))
    return out
