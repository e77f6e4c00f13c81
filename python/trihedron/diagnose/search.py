"""The search for effects: they are added, removed and exchanged by one score (eq. 11.19).

Score of an effect: twice the log-evidence that it gains, noise strengths refitted beside it, less the correction for
the shapes and effects tried. It is accepted above the threshold that the false-alarm rate sets.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from trihedron.diagnose.bias_strengths import bias_strengths, bounds_without, explain_as_much
from trihedron.diagnose.candidates import (
    N_RIVALS,
    NEAR,
    WORTH_FITTING,
    Tried,
    all_beside,
    as_fits_best,
    candidates_beside,
    with_best,
)
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.bias_process import BiasProcess
from trihedron.diagnose.effects.contract import Effect
from trihedron.diagnose.hypothesis import Hypothesis, again, without_each
from trihedron.diagnose.relations.search import Related, related

N_SENSORS = 2
"""Processes that may be replaced by effects: one of either sensor."""
MOST_EFFECTS = 4
"""Largest number of mechanisms in one session; disturbed poses do not count."""
MOST_STEPS = 8
"""Largest number of effects and disturbed poses together."""


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
    effects = catalogue() if effects is None else effects
    found = _sought(_State(_Judged(base, ())), alpha, effects)
    for _ in range(N_SENSORS):
        instead = _instead_of_a_process(found, alpha)
        if instead is None:
            break
        found = _sought(instead, alpha, effects)
    return found


def _sought(state: _State, alpha: float, effects: Sequence[Effect]) -> Found:
    drifts = {one.id for one in effects if isinstance(one, BiasProcess)}
    mechanisms = _added(state, alpha, effects, drifts)
    # Every hypothesis contains bias drift as a walk: a smooth curve is tried after the effects that explain more.
    return _concluded(_added(mechanisms, alpha, effects, {one.id for one in effects} - drifts), alpha, effects)


def _instead_of_a_process(found: Found, alpha: float) -> _State | None:
    """The hypothesis with an effect in place of a bias process that would be named, where that is likelier.

    With such an effect the bias process is no stronger than the part's own noise explains.
    """
    model = found.model
    tried = [one for one in found.tried.values() if not isinstance(one.term.effect, BiasProcess)]
    tried = [one for one in tried if one.score > -WORTH_FITTING]
    if not tried:
        return None
    for process in bias_strengths(model, alpha)[0]:
        standing = explain_as_much(process, model, tried)
        larger, chosen = with_best(model, standing) if standing else (model, None)
        if chosen is None:
            continue
        bounded = again(larger, larger.terms, bounds_without(larger, process.effect))
        judged = _Judged(bounded, without_each(bounded))
        least = judged.without[-1]
        is_likelier = 2.0 * (bounded.log_evidence - model.log_evidence) - chosen.cost > -process.price
        gained = 2.0 * (bounded.log_evidence - least.log_evidence) - chosen.cost
        if is_likelier and gained > threshold(alpha) and bounded.is_shown(least, len(bounded.terms) - 1):
            curve = found.tried.get(process.effect.id)
            return _State(judged, rivals={} if curve is None else {chosen.effect.id: [curve]})
    return None


def _added(state: _State, alpha: float, effects: Sequence[Effect], exclude: Collection[str]) -> _State:
    """Add effects one at a time until none scores above the threshold; one that lowers no held-out rms is dropped."""
    limit, judged = threshold(alpha), state.judged
    tried, missing = candidates_beside(judged.model, effects, exclude)
    for _ in range(MOST_STEPS):
        standing = [one for one in tried if one.score > limit and one.term.effect.id not in state.dropped]
        if not standing or sum(not t.effect.is_local for t in judged.model.terms) >= MOST_EFFECTS:
            break
        larger, chosen = with_best(judged.model, standing)
        if chosen is None:
            break
        if not larger.is_shown(judged.model, len(larger.terms) - 1):
            state.dropped.add(chosen.effect.id)
            continue
        judged = _Judged(larger, (*judged.without, judged.model))
        others = [one for one in standing if one.term.effect is not chosen.effect]
        state.rivals[chosen.effect.id] = others[:N_RIVALS]
        state.against.update({one.term.effect.id: chosen.effect.id for one in standing})
        tried, missing = candidates_beside(judged.model, effects, exclude)
    if judged is not state.judged:
        state.tried.clear()  # these were tried beside another hypothesis
    state.tried.update({one.term.effect.id: one for one in reversed(tried)})
    state.missing.update(missing)
    return replace(state, judged=judged)


def _concluded(state: _State, alpha: float, effects: Sequence[Effect]) -> Found:
    """Exchange every effect for the best of its rivals, and score all candidates beside the answer."""
    judged = state.judged
    if len(judged.model.terms) > 1:
        judged = _pruned(judged.model, threshold(alpha))
    swapped, named = _swapped(judged, state.rivals)
    if swapped is not judged.model:
        judged = _pruned(swapped, threshold(alpha))
    judged, beside = _beside_relations(judged, threshold(alpha))
    model = judged.model
    tried, missing = all_beside(model, effects)
    # Results with noise strengths refitted replace those at the strengths of the answer.
    beside_it = {one.term.effect.id: one for one in tried} | (state.tried if model is state.judged.model else {})
    held = {term.effect.id for term in model.terms}
    return Found(
        model, beside, beside_it,
        {key: other for key, other in state.against.items() if other in held and key not in held}, missing,
        frozenset(state.dropped),
        tuple(2.0 * (model.log_evidence - one.log_evidence) for one in judged.without), judged.without,
        tuple(tuple(named.get(term.effect.id, ())) for term in model.terms),
    )  # fmt: skip


def _beside_relations(judged: _Judged, limit: float) -> tuple[_Judged, Related]:
    """Relations without a mechanism; an effect that does not score beside them is dropped where relations in its place
    explain clearly more than it does."""
    best = related(judged.model, limit)
    if not best.relations:
        return judged, best
    alone = best.score - sum(one.score for one in best.relations)
    for k, fewer in enumerate(judged.without):
        terms = best.model.terms
        without = again(best.model, [*terms[:k], *terms[k + 1 :]])
        beside = 2.0 * (best.model.log_evidence - without.log_evidence) - terms[k].cost
        if beside > limit and not best.has_own_likelihood:
            continue
        other = related(fewer, limit)
        if other.names == best.names:
            beside = best.score - other.score
        if other.relations and other.score > alone + NEAR and beside <= limit:
            return _beside_relations(_pruned(fewer, limit), limit)
    return judged, best


@dataclass(frozen=True, eq=False)
class _Judged:
    """A hypothesis, and the hypotheses without each of its terms."""

    model: Hypothesis
    without: tuple[Hypothesis, ...]


@dataclass(frozen=True, eq=False)
class _State:
    """State of the search: its hypothesis, ids dropped, rivals of every term, candidates last tried."""

    judged: _Judged
    dropped: set[str] = field(default_factory=set)
    rivals: dict[str, list[Tried]] = field(default_factory=dict)
    against: dict[str, str] = field(default_factory=dict)
    tried: dict[str, Tried] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)


def _pruned(model: Hypothesis, limit: float) -> _Judged:
    """The hypothesis without terms that the others made redundant, the lowest score removed first."""
    while True:
        without = without_each(model)
        scores = [
            2.0 * (model.log_evidence - one.log_evidence) - term.cost if model.is_shown(one, k) else -np.inf
            for k, (term, one) in enumerate(zip(model.terms, without, strict=True))
        ]
        if not scores or min(scores) > limit:
            return _Judged(model, without)
        model = without[int(np.argmin(scores))]


def _swapped(judged: _Judged, rivals: dict[str, list[Tried]]) -> tuple[Hypothesis, dict[str, list[str]]]:
    """Exchange every term for its best rival beside all others; and list the rivals that explain as much."""
    model = judged.model
    named: dict[str, list[str]] = {}
    for k, without in enumerate(judged.without):
        term = model.terms[k]
        scored = [(2.0 * model.log_evidence - term.cost, model, term)]
        for other in _others(rivals.get(term.effect.id, []), {t.effect.id for t in model.terms}):
            fitted = as_fits_best(without, other)
            swapped = again(model, [*model.terms[:k], fitted, *model.terms[k + 1 :]])
            if fitted.effect.is_plausible(fitted.variant, *swapped.value(k)):
                scored.append((2.0 * swapped.log_evidence - fitted.cost, swapped, fitted))
        _, model, chosen = max(scored, key=lambda one: one[0])
        least = model.log_evidence - 0.5 * NEAR
        named[chosen.effect.id] = [
            t.effect.id for _, one, t in scored if one.log_evidence > least and t.effect is not chosen.effect
        ]
    return model, named


def _others(rivals: Iterable[Tried], held: set[str]) -> list[Tried]:
    """Rivals that are not in the hypothesis and score near the first of them."""
    free = [one for one in rivals if one.term.effect.id not in held]
    return [one for one in free if one.score > free[0].score - WORTH_FITTING] if free else []
