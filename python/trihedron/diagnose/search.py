"""The one search: effects are added, dropped and swapped by one score (eq. 11.19).

Score of an effect: twice the log-evidence that it gains, all strengths of noise found anew beside it, less what trying
its shapes and the whole catalogue costs. It stands where that is more than the odds that the false-alarm rate asks for.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from trihedron.diagnose.bias_strengths import bias_strengths, bounds_without, explain_as_much
from trihedron.diagnose.candidates import NEAR, Tried, all_beside, candidates_beside
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.bias_process import BiasProcess
from trihedron.diagnose.hypothesis import Hypothesis, Term, again, hypothesis, without_each
from trihedron.diagnose.relations.search import Related, related
from trihedron.diagnose.residuals.goodness_of_fit import physical_rms
from trihedron.diagnose.session.state import (
    DYNAMICS,
    MOVES,
    STATIC_ACCEL,
    STATIC_GYRO,
    Distortion,
)
from trihedron.diagnose.shapes import as_fits_best
from trihedron.threads import side_by_side

WORTH_FITTING, OF_THE_BEST = 20.0, 0.5
"""Difference of scores, one linear step from the fit, within which rivals are fitted in full; and the part of the best
score from which they are: the larger an effect, the farther off is what one step says of it."""
N_RIVALS = 3
"""Rivals fitted in full."""
N_SENSORS = 2
MOST_EFFECTS = 4
"""Mechanisms of one session at most; poses that were pushed are none."""
MOST_STEPS = 8
"""Effects and pushed poses together, at most."""
OWN_DOMAINS = {"force": (STATIC_ACCEL, DYNAMICS), "rate": (STATIC_GYRO, MOVES, DYNAMICS)}
"""Where a flaw of one sensor must show: velocity needs both, a tilted force being half of it."""


@dataclass(frozen=True, eq=False)
class Found:
    """Where the search ended.

    ``tried`` are, by id, candidates beside the final hypothesis, ``against`` what took the place of those that had
    stood, ``missing`` why others do not apply; ``gains`` twice the log-evidence of every term, ``scores`` what is left
    of that after its price, ``without`` the final hypothesis without it, ``rivals`` effects that explain as much.
    """

    model: Hypothesis
    related: Related
    """The final hypothesis with what else it follows."""
    tried: dict[str, Tried] = field(default_factory=dict)
    against: dict[str, str] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)
    gains: tuple[float, ...] = ()
    without: tuple[Hypothesis, ...] = ()
    rivals: tuple[tuple[str, ...], ...] = ()

    @property
    def scores(self) -> tuple[float, ...]:
        """What is left of every term's gain."""
        return tuple(gain - term.paid for gain, term in zip(self.gains, self.model.terms, strict=True))


def threshold(alpha: float) -> float:
    """Score from which an effect stands: twice the logarithm of odds of 1/2α, half of the false alarms being the
    search's.

    In 40 sessions with every small fault of real ones but no effect none came above -7 (benches/blind_nuisances.py).
    """
    return float(-2.0 * np.log(2.0 * alpha))


def search(base: Hypothesis, alpha: float) -> Found:
    """The effects that a session demands: the best is added, again; then each is dropped, or swapped, if that gains."""
    found = _sought(_State(_Judged(base, ())), alpha)
    for _ in range(N_SENSORS):
        instead = _instead_of_a_process(found, alpha)
        if instead is None:
            break
        found = _sought(instead, alpha)
    return found


def _sought(state: _State, alpha: float) -> Found:
    drifts = {one.id for one in catalogue() if isinstance(one, BiasProcess)}
    mechanisms = _added(state, alpha, drifts)
    # A bias that drifts is in every hypothesis as a walk: a smooth curve is asked beside what explains more than time.
    return _concluded(_added(mechanisms, alpha, {one.id for one in catalogue()} - drifts), alpha)


def _instead_of_a_process(found: Found, alpha: float) -> _State | None:
    """The hypothesis with an effect in the place of a process of the bias that would be named, where that is likelier.

    Beside an effect that explains what a bias does by itself the bias does no more than the part's noise makes it do.
    """
    model = found.model
    tried = [one for one in found.tried.values() if not isinstance(one.term.effect, BiasProcess)]
    tried = [one for one in tried if one.score > -WORTH_FITTING]
    if not tried:
        return None
    for process in bias_strengths(model, alpha)[0]:
        standing = explain_as_much(process, model, tried)
        larger, chosen = _with_best(model, standing) if standing else (model, None)
        if chosen is None:
            continue
        bounded = again(larger, larger.terms, bounds_without(larger, process.effect))
        judged = _Judged(bounded, without_each(bounded))
        least = judged.without[-1]
        is_likelier = 2.0 * (bounded.log_evidence - model.log_evidence) - chosen.paid > -process.price
        gained = 2.0 * (bounded.log_evidence - least.log_evidence) - chosen.paid
        if is_likelier and gained > threshold(alpha) and _is_shown(bounded, least, len(bounded.terms) - 1):
            curve = found.tried.get(process.effect.id)
            return _State(judged, rivals={} if curve is None else {chosen.effect.id: [curve]})
    return None


def _added(state: _State, alpha: float, exclude: Collection[str]) -> _State:
    """Effects added one at a time until none is demanded, those that become needless dropped at once."""
    limit, judged = threshold(alpha), state.judged
    tried, missing = candidates_beside(judged.model, exclude)
    for _ in range(MOST_STEPS):
        standing = [one for one in tried if one.score > limit and one.term.effect.id not in state.dropped]
        if not standing or sum(not t.effect.is_local for t in judged.model.terms) >= MOST_EFFECTS:
            break
        larger, chosen = _with_best(judged.model, standing)
        if chosen is None:
            break
        if not _is_shown(larger, judged.model, len(larger.terms) - 1):
            state.dropped.add(chosen.effect.id)
            continue
        judged = _Judged(larger, (*judged.without, judged.model))
        others = [one for one in standing if one.term.effect is not chosen.effect]
        state.rivals[chosen.effect.id] = others[:N_RIVALS]
        state.against.update({one.term.effect.id: chosen.effect.id for one in standing})
        tried, missing = candidates_beside(judged.model, exclude)
    if judged is not state.judged:
        state.tried.clear()  # what was tried before was tried beside another hypothesis
    state.tried.update({one.term.effect.id: one for one in reversed(tried)})
    state.missing.update(missing)
    return replace(state, judged=judged)


def _concluded(state: _State, alpha: float) -> Found:
    """Every effect the best of its rivals; and what all that was tried comes to beside the answer."""
    judged = state.judged
    if len(judged.model.terms) > 1:
        judged = _pruned(judged.model, threshold(alpha))
    swapped, named = _swapped(judged, state.rivals)
    if swapped is not judged.model:
        judged = _pruned(swapped, threshold(alpha))
    judged, beside = _beside_relations(judged, threshold(alpha))
    model = judged.model
    tried, missing = all_beside(model)
    # What was asked with the noise found anew is worth more than a look in the noise of the answer.
    beside_it = {one.term.effect.id: one for one in tried} | (state.tried if model is state.judged.model else {})
    held = {term.effect.id for term in model.terms}
    return Found(
        model, beside, beside_it,
        {key: other for key, other in state.against.items() if other in held and key not in held}, missing,
        tuple(2.0 * (model.log_evidence - one.log_evidence) for one in judged.without), judged.without,
        tuple(tuple(named.get(term.effect.id, ())) for term in model.terms),
    )  # fmt: skip


def _beside_relations(judged: _Judged, limit: float) -> tuple[_Judged, Related]:
    """What follows something without a name; a name goes where relations explain clearly more without it."""
    best = related(judged.model, limit)
    if not best.relations:
        return judged, best
    for k, fewer in enumerate(judged.without):
        # What stands beside the relations is not theirs.
        without = again(best.model, [t for j, t in enumerate(best.model.terms) if j != k])
        gained = 2.0 * (best.model.log_evidence - without.log_evidence) - judged.model.terms[k].paid
        if gained > limit:
            continue
        other = related(fewer, limit)
        if other.relations and other.score > best.score + NEAR:
            return _beside_relations(_pruned(fewer, limit), limit)
    return judged, best


@dataclass(frozen=True, eq=False)
class _Judged:
    """A hypothesis, and what it is without each of its terms."""

    model: Hypothesis
    without: tuple[Hypothesis, ...]


@dataclass(frozen=True, eq=False)
class _State:
    """Where a search stands: its hypothesis, what went, what came near every term, what was tried last."""

    judged: _Judged
    dropped: set[str] = field(default_factory=set)
    rivals: dict[str, list[Tried]] = field(default_factory=dict)
    against: dict[str, str] = field(default_factory=dict)
    tried: dict[str, Tried] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)


def _with_best(model: Hypothesis, standing: list[Tried]) -> tuple[Hypothesis, Term | None]:
    """The hypothesis with the best of the candidates that come near the first, each fitted in full."""
    first = standing[0].score
    near = [one for one in standing if one.score > min(first - WORTH_FITTING, OF_THE_BEST * first)][:N_RIVALS]
    best: tuple[float, Hypothesis, Term] | None = None
    for term, larger in side_by_side(lambda one: _fitted_beside(model, one), near):
        value, covariance = larger.value(len(larger.terms) - 1)
        if not term.effect.is_plausible_variant(term.variant, value, covariance):
            continue
        score = 2.0 * larger.log_evidence - term.paid
        if best is None or score > best[0]:
            best = score, larger, term
    return (model, None) if best is None else best[1:]


def _fitted_beside(model: Hypothesis, tried: Tried) -> tuple[Term, Hypothesis]:
    term = as_fits_best(model, tried)
    state = model.fitted.state
    start = replace(state, effect=np.concatenate([state.effect, np.zeros(term.distortion.n_parameters)]))
    strengths = tried.asked.strengths
    return term, hypothesis(model.obs, start, model.prior, (*model.terms, term), model.within, strengths)


def _pruned(model: Hypothesis, limit: float) -> _Judged:
    """The hypothesis without terms that the others have made needless, the one with least to show first."""
    while True:
        without = without_each(model)
        scores = [
            2.0 * (model.log_evidence - one.log_evidence) - term.paid if _is_shown(model, one, k) else -np.inf
            for k, (term, one) in enumerate(zip(model.terms, without, strict=True))
        ]
        if not scores or min(scores) > limit:
            return _Judged(model, without)
        model = without[int(np.argmin(scores))]


def _is_shown(model: Hypothesis, without: Hypothesis, k: int) -> bool:
    """Whether an effect has a size, and lowers the held-out rms, in physical units, of a domain of its own sensor."""
    value, covariance = model.value(k)
    if not (np.abs(value) > np.sqrt(np.maximum(np.diag(covariance), 0.0))).any():
        return False
    before, _ = physical_rms(without.fitted, without.prediction.innovation)
    after, _ = physical_rms(model.fitted, model.prediction.innovation)
    return any(after[d] < before[d] for d in own_domains(model.terms[k].distortion) if d in after and d in before)


def own_domains(distortion: Distortion) -> tuple[int, ...]:
    """Row domains of the sensors that an effect adds to."""
    sides = [own for side, own in OWN_DOMAINS.items() if getattr(distortion, side) is not None]
    return tuple(dict.fromkeys(d for own in sides for d in own))


def _swapped(judged: _Judged, rivals: dict[str, list[Tried]]) -> tuple[Hypothesis, dict[str, list[str]]]:
    """Every term the best of those that might stand in its place, beside all others; and which explain as much."""
    model = judged.model
    named: dict[str, list[str]] = {}
    for k, without in enumerate(judged.without):
        term = model.terms[k]
        scored = [(2.0 * model.log_evidence - term.paid, model, term)]
        for other in _others(rivals.get(term.effect.id, []), {t.effect.id for t in model.terms}):
            fitted = as_fits_best(without, other)
            swapped = again(model, [*model.terms[:k], fitted, *model.terms[k + 1 :]])
            if fitted.effect.is_plausible_variant(fitted.variant, *swapped.value(k)):
                scored.append((2.0 * swapped.log_evidence - fitted.paid, swapped, fitted))
        _, model, chosen = max(scored, key=lambda one: one[0])
        least = model.log_evidence - 0.5 * NEAR
        named[chosen.effect.id] = [
            t.effect.id for _, one, t in scored if one.log_evidence > least and t.effect is not chosen.effect
        ]
    return model, named


def _others(rivals: Iterable[Tried], held: set[str]) -> list[Tried]:
    """Rivals that are not in the hypothesis, those that came near."""
    free = [one for one in rivals if one.term.effect.id not in held]
    return [one for one in free if one.score > free[0].score - WORTH_FITTING] if free else []
