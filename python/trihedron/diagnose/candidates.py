"""The whole catalogue beside a hypothesis: which effects gain, by how much, at which size and shape (eq. 11.19)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.hypothesis import Asked, Hypothesis, Look, Term

PRIOR_SCALES = (1.0, 0.3, 0.1)
"""Parts differ by ten from what data sheets of their kind say: the size expected is one of these times that."""
RESCALED = (3.0, 0.3)
"""What leads is asked at the sizes next to the one that a look at fixed strengths took it to have."""
N_LEADERS = 3
"""Effects taken from every look at the whole catalogue to the full evidence."""
SHAPES_KEPT = 2
"""Shapes of one effect that go along, of those that its size so far makes possible and of those that it does not."""
N_RESIZED = 3
"""Candidates whose expected size is asked anew."""
NEAR = 6.0
"""Difference of scores below which two explanations are named together: odds of twenty to one."""
FAMILY = NEAR
"""What a shape that stands for a family (a filter of any order) pays besides: odds of twenty to one."""


@dataclass(frozen=True, eq=False)
class Tried:
    """A candidate beside a hypothesis: its score, and what it comes to there."""

    term: Term
    score: float
    asked: Asked

    @property
    def p_value(self) -> float:
        """Wald's test of its parameters, in the noise found beside them."""
        value, covariance = self.asked.value, self.asked.covariance
        wald = float(value @ np.linalg.solve(covariance, value))
        return float(max(chdtrc(len(value), max(wald, 0.0)), 1e-300))


def all_beside(model: Hypothesis) -> tuple[list[Tried], dict[str, str]]:
    """The whole catalogue beside a hypothesis, its noise as strong as it is there; and why others do not apply."""
    terms, missing = terms_beside(model, ())
    looks = model.looked_at(terms, PRIOR_SCALES) if terms else []
    asked = [
        Asked(model.log_evidence + float(look.gain[:, 0].max()), model.strengths, look.value, look.covariance)
        for look in looks
    ]
    return _best_of_each(terms, asked, model.log_evidence), missing


def candidates_beside(model: Hypothesis, exclude: Collection[str]) -> tuple[list[Tried], dict[str, str]]:
    """Candidates beside a hypothesis, best first, one an effect; and why others do not apply."""
    terms, missing = terms_beside(model, exclude)
    if not terms:
        return [], missing
    leading = _leaders(model, terms)
    asked = model.asked(leading)
    # Columns made for one size (a delay) are made again for the size that they come out with.
    sized = {
        k: replace(term, variant=made)
        for k, (term, one) in enumerate(zip(leading, asked, strict=True))
        if (made := term.effect.rescaled(model.context, term.variant, one.value)) is not None
    }
    for k, one in zip(sized, model.asked(list(sized.values())), strict=True):
        leading[k], asked[k] = sized[k], one
    plain = model.plain([one.strengths for one in asked])
    best = _best_of_each(leading, asked, plain)
    # What leads may be larger or smaller than the look at fixed strengths took it to be.
    first = [one.term for one in best[:N_RESIZED]]
    other = [replace(t, sizes=t.sizes * scale) for t in first for scale in RESCALED]
    found = _best_of_each([*leading, *other], [*asked, *(model.asked(other) if other else [])], plain)
    return found, missing


def _best_of_each(terms: Sequence[Term], asked: Sequence[Asked], plain: float) -> list[Tried]:
    """The best shape of every effect that is a possible one, best effect first."""
    best: dict[str, Tried] = {}
    for term, one in zip(terms, asked, strict=True):
        score = 2.0 * (one.log_evidence - plain) - term.paid
        known = best.get(term.effect.id)
        if (known is None or score > known.score) and _is_possible(term, one):
            best[term.effect.id] = Tried(term, score, one)
    return sorted(best.values(), key=lambda one: -one.score)


def terms_beside(model: Hypothesis, exclude: Collection[str]) -> tuple[list[Term], dict[str, str]]:
    """Every shape of every effect that applies and is not there yet."""
    context = model.context
    held = {t.effect.id for t in model.terms if not t.effect.repeatable} | set(exclude)
    places = {(t.effect.id, t.variant.label) for t in model.terms}
    reasons = {effect.id: effect.unavailable(context) for effect in catalogue()}
    terms, missing = [], {key: reason for key, reason in reasons.items() if reason is not None and key not in held}
    price = price_of_choice(reasons.values())
    for effect in catalogue():
        if effect.id in held or reasons[effect.id] is not None:
            continue
        variants = [v for v in effect.variants(context) if (effect.id, v.label) not in places]
        paid = price + 2.0 * float(np.log(max(len(variants), 1) * len(PRIOR_SCALES)))
        # A shape that stands for a family, a filter of any order, costs as much again as one that stands for itself.
        terms += [Term(effect, v, effect.sizes(context, v), paid + FAMILY * v.stands_for_many) for v in variants]
    return terms, missing


def price_of_choice(reasons: Iterable[str | None]) -> float:
    """What one effect pays for being chosen from those that apply, in twice a log-likelihood: alike for all of them,
    in whatever order they are asked."""
    return 2.0 * float(np.log(max(sum(reason is None for reason in reasons), 1)))


def _leaders(model: Hypothesis, terms: list[Term]) -> list[Term]:
    """The candidates that gain most one linear step from the fit, at its strengths and at others, as large as fits."""
    looks = model.looked_at(terms, PRIOR_SCALES)
    gains = np.stack([look.gain for look in looks], axis=1)
    possible = [_can_be(model, term, look) for term, look in zip(terms, looks, strict=True)]
    kept: dict[int, int] = {}
    for look in range(gains.shape[2]):
        best = gains[:, :, look].max(axis=0)
        count: Counter[tuple[str, bool]] = Counter()
        led: set[str] = set()
        for k in np.argsort(-best).tolist():
            shape = terms[k].effect.id, possible[k]
            if count[shape] < SHAPES_KEPT and (shape[0] in led or len(led) < N_LEADERS):
                count[shape] += 1
                led.add(shape[0])
                kept.setdefault(k, int(gains[:, k, look].argmax()))
    return [replace(terms[k], sizes=terms[k].sizes * PRIOR_SCALES[scale]) for k, scale in kept.items()]


def _can_be(model: Hypothesis, term: Term, look: Look) -> bool:
    """Whether an effect can have the size that it has in a look, or would in columns made for that size."""
    effect = term.effect
    is_plausible = effect.is_plausible_variant(term.variant, look.value, look.covariance)
    return is_plausible or effect.rescaled(model.context, term.variant, look.value) is not None


def _is_possible(term: Term, asked: Asked) -> bool:
    return term.effect.is_plausible_variant(term.variant, asked.value, asked.covariance)
