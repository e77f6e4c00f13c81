"""The search for effects: they are added, removed and exchanged by one score (eq. 11.19).

Score of an effect: twice the log-evidence that it gains, noise strengths refitted beside it, less the correction for
the shapes and effects tried. It is accepted above the threshold that the false-alarm rate sets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from trihedron.diagnose.bias_strengths import bias_strengths, bounds_without, explain_as_much
from trihedron.diagnose.candidates import (
    Tried,
    all_beside,
    candidates_beside,
    fitted_near,
    price_of_choice,
    with_best,
    worth_fitting,
)
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.bias_process import BiasProcess
from trihedron.diagnose.effects.contract import SENSORS, Effect
from trihedron.diagnose.hypothesis import Hypothesis, again
from trihedron.diagnose.relations.search import Related, related
from trihedron.probability import STRONG_SCORE


@dataclass(frozen=True, eq=False)
class Found:
    """Result of the search.

    By id: ``tried`` candidates beside the final hypothesis, ``against`` what took the place of those once above the
    threshold, ``missing`` why others do not apply, ``dropped`` those that lower no held-out rms. Per term: ``gains``
    twice the log-evidence, ``scores`` the gain less its penalty, ``without`` the final hypothesis without it,
    ``rivals`` effects that explain as much.
    """

    model: Hypothesis
    related: Related
    """The final hypothesis with the empirical relations found beside it."""
    tried: dict[str, Tried] = field(default_factory=dict)
    against: dict[str, str] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)
    dropped: frozenset[str] = frozenset()
    gains: tuple[float, ...] = ()
    without: tuple[Hypothesis, ...] = ()
    rivals: tuple[tuple[str, ...], ...] = ()

    @property
    def scores(self) -> tuple[float, ...]:
        """Gain of every term less its penalty for the choice among shapes and effects."""
        return tuple(gain - term.cost for gain, term in zip(self.gains, self.model.terms, strict=True))


def threshold(alpha: float) -> float:
    """Score above which an effect is accepted: twice the logarithm of odds of 1/2α, half of the false alarms being the
    search's.

    In 40 sessions with every small error of real ones but no effect no score is above -7 (benches/blind_nuisances.py).
    """
    return float(-2.0 * np.log(2.0 * alpha))


def search(base: Hypothesis, alpha: float, effects: Sequence[Effect] | None = None) -> Found:
    """The effects of a session: the best of the catalogue, or of ``effects``, is added repeatedly, then each is removed
    or exchanged if that is better."""
    one = _Search(alpha, threshold(alpha), catalogue() if effects is None else effects)
    found = one.concluded(one.added(base))
    # One process of either sensor may be replaced by effects.
    for _ in SENSORS:
        instead = one.instead_of_a_process(found)
        if instead is None:
            break
        found = one.concluded(one.added(instead))
    return found


@dataclass(frozen=True, eq=False)
class _Search:
    """A search among ``effects``, accepted above ``limit``; ``dropped`` are ids of those that lower no held-out rms."""

    alpha: float
    limit: float
    effects: Sequence[Effect]
    dropped: set[str] = field(default_factory=set)

    def added(self, model: Hypothesis) -> Hypothesis:
        """The hypothesis with effects added one at a time until none scores above the threshold."""
        while (larger := self._with_one_more(model)) is not None:
            model = larger
        return model

    def _with_one_more(self, model: Hypothesis) -> Hypothesis | None:
        """The hypothesis with the best effect that lowers a held-out rms, or none."""
        tried = candidates_beside(model, self.effects, self.dropped)
        standing = [one for one in tried if one.score > self.limit]
        while standing:
            larger, chosen = with_best(model, standing)
            if chosen is None or larger.is_shown(model, len(model.terms)):
                return None if chosen is None else larger
            self.dropped.add(chosen.effect.id)
            standing = [one for one in standing if one.term.effect.id != chosen.effect.id]
        return None

    def instead_of_a_process(self, found: Found) -> Hypothesis | None:
        """The hypothesis with an effect in place of a bias process that would be named, where that is likelier.

        With such an effect the bias process is no stronger than the part's own noise explains.
        """
        model = found.model
        near, price = -STRONG_SCORE - price_of_choice(model, self.effects), price_of_choice(model, catalogue())
        tried = [one for one in found.tried.values() if one.score > near]
        tried = [one for one in tried if not isinstance(one.term.effect, BiasProcess)]
        for process in bias_strengths(model, self.alpha)[0] if tried else ():
            standing = explain_as_much(process, model, tried)
            larger, chosen = with_best(model, standing)
            if chosen is None:
                continue
            bounded = again(larger, larger.terms, bounds_without(larger, process.effect))
            least = again(bounded, bounded.terms[:-1])
            gains = bounded.gain_over(model) + price, bounded.gain_over(least) - self.limit
            if min(gains) > chosen.cost and bounded.is_shown(least, len(model.terms)):
                return bounded
        return None

    def concluded(self, model: Hypothesis) -> Found:
        """Remove effects that others made redundant, exchange each for the best of its rivals, and score all candidates
        beside the answer."""
        model = self._pruned(model)
        swapped, rivals, against = self._swapped(model)
        model, beside = self._beside_relations(model if swapped is model else self._pruned(swapped))
        stated, missing = all_beside(model, self.effects)
        # Results with noise strengths refitted replace those at the strengths of the answer, of an effect the best.
        # Rivals of a bias process, which pays the same price, are those down to ``STRONG_SCORE`` below it.
        least = -STRONG_SCORE - price_of_choice(model, self.effects)
        tried = [*reversed(stated), *reversed(candidates_beside(model, self.effects, (), least))]
        held = {term.effect.id for term in model.terms}
        return Found(
            model, beside, {one.term.effect.id: one for one in tried},
            {key: other for key, other in against.items() if other in held and key not in held}, missing,
            frozenset(self.dropped), tuple(model.gain_over(one) for one in model.without), model.without,
            tuple(rivals.get(term.effect.id, ()) for term in model.terms),
        )  # fmt: skip

    def _pruned(self, model: Hypothesis) -> Hypothesis:
        """The hypothesis without terms that the others made redundant, the lowest score removed first."""
        while True:
            scores = [
                model.gain_over(one) - term.cost if model.is_shown(one, k) else -np.inf
                for k, (term, one) in enumerate(zip(model.terms, model.without, strict=True))
            ]
            if not scores or min(scores) > self.limit:
                return model
            model = model.without[int(np.argmin(scores))]

    def _swapped(self, model: Hypothesis) -> tuple[Hypothesis, dict[str, tuple[str, ...]], dict[str, str]]:
        """Exchange every term for its best rival beside all others. By id: rivals that explain as much as a term, and
        the term that stands in the place of a candidate."""
        rivals: dict[str, tuple[str, ...]] = {}
        against: dict[str, str] = {}
        for k, fewer in enumerate(model.without):
            own = model.terms[k].effect.id
            tried = candidates_beside(fewer, self.effects, {one.effect.id for one in model.terms} - {own})
            others = [one for one in worth_fitting(tried) if one.term.effect.id != own]
            made = [model, *fitted_near(model, others, k)]
            model = max(made, key=lambda one: one.score(k))
            chosen = model.terms[k].effect.id
            near = (one.terms[k].effect.id for one in made if model.gain_over(one) < STRONG_SCORE)
            rivals[chosen] = tuple(key for key in dict.fromkeys(near) if key != chosen)
            against |= {one.term.effect.id: chosen for one in tried if one.score > self.limit}
            against.pop(chosen, None)
        return model, rivals, against

    def _beside_relations(self, model: Hypothesis) -> tuple[Hypothesis, Related]:
        """Relations without a mechanism. An effect goes where it is not needed beside them, or where one more in its
        place scores more; where none stands beside it, as it resembles one, clearly more."""
        best = related(model, self.limit)
        needed = best.score + (0.0 if best.relations else STRONG_SCORE)
        for k, (term, fewer) in enumerate(zip(model.terms, model.without, strict=True)):
            kept = [*best.model.terms[:k], *best.model.terms[k + 1 :]]
            beside = again(best.model, kept) if best.relations else fewer
            score = best.model.gain_over(beside) - term.cost
            if score < self.limit or related(fewer, self.limit, best.relations).score > needed:
                return self._beside_relations(self._pruned(fewer))
        return model, best
