"""What the whole comes to: which domains could be tested at all, what is left, and the one word for it."""

from __future__ import annotations

from dataclasses import replace

from trihedron.diagnose.accepted import Answer
from trihedron.diagnose.effects import catalogue
from trihedron.records.diagnosis import Verdict
from trihedron.records.domains import DomainTest

SAMPLE_DOMAINS = ("within-static", "timing")
"""Domains of the samples themselves, which no parameter of the model is fitted to."""
POSE_DOMAINS = ("static-accel", "moves", "dynamics")
"""Domains that hold the model against gravity or rest: without one of them there is nothing to contradict it."""
LEAST_DOF = 1.0
"""Degrees of freedom below which a domain's rows are used up by the fit itself."""


def accounted_for(answer: Answer, remaining: tuple[DomainTest, ...]) -> tuple[DomainTest, ...]:
    """Sample-level domains whose disagreement an accepted effect is, seen from another side, agree afterwards."""
    explained = {one.evidence.domain for one in answer.seen}
    explained |= {domain for one in catalogue() if one.id in answer.ids for domain in one.accounts_for}
    return tuple(
        replace(d, disagrees=False) if d.domain in explained and d.domain in SAMPLE_DOMAINS else d for d in remaining
    )


def verdict_of(
    answer: Answer,
    domains: tuple[DomainTest, ...],
    remaining: tuple[DomainTest, ...] = (),
    *,
    has_relations: bool = False,
) -> Verdict:
    """One word; ``not-testable`` where neither gravity nor rest had a say and the samples show nothing either.

    Footnotes (one pushed pose, a faint line) are no answer while something else disagrees.
    """
    if answer.ids:
        is_left = has_relations or any(d.disagrees for d in remaining)
        says_why = not answer.are_footnotes and not answer.are_spread
        return "missing-physics" if says_why or not is_left else "unexplained"
    if has_relations or any(d.disagrees for d in domains):
        return "unexplained"
    # A weak prior fills what the poses leave open; rows that it alone decides test nothing.
    if not any(d.domain in POSE_DOMAINS and d.dof >= LEAST_DOF for d in domains):
        return "not-testable"
    return "consistent"
