"""Every effect of the catalogue added to a hypothesis: which gain, how much, at which size and shape (eq. 11.19)."""

import math
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.diagnose.effects.contract import PRIOR_SCALES, Effect, Variant
from trihedron.diagnose.hypothesis import AddedTerms, Hypothesis, Term, again
from trihedron.diagnose.session.solve import Distortion
from trihedron.probability import STRONG_SCORE, chdtrc
from trihedron.threads import side_by_side

OF_THE_BEST = 0.5
"""Rivals are fitted in full from this share of the best score on, one linear step from the fit, or where they explain
as much: one step predicts a large effect poorly."""
N_LEADERS = 3
"""Effects of each screening at fixed noise strengths that are evaluated with noise strengths refitted, shapes of each
(as many with a plausible and an implausible size, with a shape parameter and without), rivals fitted in full."""
AT_ONCE = 16
"""Effects whose columns are computed together."""


@dataclass(frozen=True, eq=False)
class Tried:
    """A candidate added to a hypothesis: its score, its evidence and its parameters."""

    term: Term
    score: float
    asked: AddedTerms

    @property
    def p_value(self) -> float:
        """Wald test of its parameters, with the noise strengths refitted beside it."""
        return wald_p(self.asked.value, self.asked.covariance)


def wald_p(value: FloatArray, covariance: FloatArray) -> float:
    """p-value of parameters (k,) against zero, by their covariance (k, k)."""
    wald = float(value @ np.linalg.solve(covariance, value))
    return max(chdtrc(len(value), max(wald, 0.0)), TINY)


def all_beside(model: Hypothesis, effects: Sequence[Effect]) -> tuple[list[Tried], dict[str, str]]:
    """Every effect added to the hypothesis at its noise strengths; and the reasons why others do not apply."""
    price, reasons = price_of_choice(model, effects), {one.id: one.unavailable(model.context) for one in effects}
    terms = [term for effect in offered_beside(model, effects, ()) for term in terms_of(model, effect, price)]
    asked = model.at_its_strengths(terms, PRIOR_SCALES)
    missing = {key: reason for key, reason in reasons.items() if reason is not None}
    return _best_of_each(terms, asked, model.log_evidence, is_stated=True), missing


def candidates_beside(
    model: Hypothesis, effects: Sequence[Effect], exclude: Collection[str], least: float = -STRONG_SCORE
) -> list[Tried]:
    """Candidates to add to a hypothesis, best first, that score more than ``least`` at some strengths."""
    offered = offered_beside(model, effects, exclude)
    leading = _leaders(model, offered, price_of_choice(model, effects), least)
    if not leading:
        return []
    asked = model.with_added(leading)
    # Columns that depend on the size (a delay) are computed again for the fitted size.
    sized = {
        k: term.of_size(model.context, made)
        for k, (term, one) in enumerate(zip(leading, asked, strict=True))
        if (made := term.effect.rescaled(model.context, term.variant, one.value)) is not None
    }
    for k, one in zip(sized, model.with_added(list(sized.values())), strict=True):
        leading[k], asked[k] = sized[k], one
    plain = model.plain([one.strengths for one in asked])
    # The screening at fixed noise strengths may have chosen a prior width that is too small or too large.
    other = [by for scale in PRIOR_SCALES[1:] for by in (scale, 1.0 / scale)]
    terms = [term.scaled(by) for by in (1.0, *other) for term in leading]
    under = [one.with_prior(t.sizes, t.sizes * by) for by in other for t, one in zip(leading, asked, strict=True)]
    return _best_of_each(terms, [*asked, *under], plain)


def _best_of_each(
    terms: Sequence[Term], asked: Sequence[AddedTerms], plain: float, *, is_stated: bool = False
) -> list[Tried]:
    """The best shape with a plausible size of every effect, and the best of those whose shape can be fitted, best
    first; where it ``is_stated`` what a log says of an effect also one without evidence whose size is none (a delay far
    from those that were tried)."""
    best: dict[tuple[str, bool], tuple[bool, float, Tried]] = {}
    for term, one in zip(terms, asked, strict=True):
        score = 2.0 * (one.log_evidence - plain) - term.cost
        is_plausible = term.effect.is_plausible(term.variant, one.value, one.covariance)
        rank = is_plausible, score, Tried(term, score, one)
        is_none = is_stated and score <= 0.0 and not term.effect.of_session
        kind = term.effect.id, bool(term.variant.shape)
        if (is_plausible or is_none) and rank[:2] > best.get(kind, (False, -np.inf))[:2]:
            best[kind] = rank
    return sorted((one for *_, one in best.values()), key=lambda one: -one.score)


def offered_beside(model: Hypothesis, effects: Sequence[Effect], exclude: Collection[str]) -> list[Effect]:
    """The effects that apply and are not included."""
    held = {t.effect.id for t in model.terms if not t.effect.is_local} | set(exclude)
    return [one for one in effects if one.id not in held and one.unavailable(model.context) is None]


def terms_of(model: Hypothesis, effect: Effect, price: float) -> list[Term]:
    """Every shape of an effect; ``price`` is the correction for the choice among effects. Its kinds (line, warm-up) are
    as likely as each other, and the shapes of a kind share that: a lag fitted for nothing is less likely than none."""
    context, places = model.context, {(t.effect.id, t.variant.label) for t in model.terms}
    variants = [v for v in effect.variants(context) if (effect.id, v.label) not in places]
    of_kind = Counter(v.label for v in variants)
    tried = [len(of_kind) * of_kind[v.label] * v.n_places * len(PRIOR_SCALES) for v in variants]
    costs = price + 2.0 * np.log(tried)
    return [Term(effect, v, effect.sizes(context, v), float(cost)) for v, cost in zip(variants, costs, strict=True)]


def price_of_choice(model: Hypothesis, effects: Sequence[Effect]) -> float:
    """Selection penalty of one of some effects, in twice a log-likelihood: 2 ln of the number that apply. It is the
    same for all of them and independent of their order."""
    return 2.0 * float(np.log(max(sum(one.unavailable(model.context) is None for one in effects), 1)))


def _leaders(model: Hypothesis, offered: Sequence[Effect], price: float, least: float) -> list[Term]:
    """Candidates that gain most one linear step from the fit, at its noise strengths and others, at their best size."""
    kept: list[tuple[Term, bool, FloatArray]] = []
    # A few at a time: the columns of all relations together need more memory than the log.
    for first in range(0, len(offered), AT_ONCE):
        terms = [term for effect in offered[first : first + AT_ONCE] for term in terms_of(model, effect, price)]
        looks = zip(terms, model.gains(terms, PRIOR_SCALES), strict=True)
        may = [(term, *look) for term, look in looks if 2.0 * float(look[0].max()) - term.cost > least]
        kept = _ahead([*kept, *((term, _can_be(model, term, look), gain) for term, gain, look in may)])
    scales = [PRIOR_SCALES[int(gain.max(axis=1).argmax())] for *_, gain in kept]
    return [term.scaled(scale) for (term, *_), scale in zip(kept, scales, strict=True)]


def _ahead(seen: list[tuple[Term, bool, FloatArray]]) -> list[tuple[Term, bool, FloatArray]]:
    """Those of some terms that lead at any strengths, by their gains (prior scales, strengths)."""
    kept: dict[int, tuple[Term, bool, FloatArray]] = {}
    for best in zip(*(gain.max(axis=0) for *_, gain in seen), strict=True):
        count: Counter[tuple[str, bool, bool]] = Counter()
        led: set[str] = set()
        for k in sorted(range(len(seen)), key=lambda k: -best[k]):
            term, can_be, _ = seen[k]
            shape = term.effect.id, can_be, bool(term.variant.shape)
            if count[shape] < N_LEADERS and (shape[0] in led or len(led) < N_LEADERS):
                count[shape] += 1
                led.add(shape[0])
                kept[k] = seen[k]
    return list(kept.values())


def _can_be(model: Hypothesis, term: Term, look: AddedTerms) -> bool:
    """Whether the size found in a look is plausible, or columns can be computed anew for that size."""
    effect = term.effect
    is_plausible = effect.is_plausible(term.variant, look.value, look.covariance)
    return is_plausible or effect.rescaled(model.context, term.variant, look.value) is not None


def worth_fitting(tried: Sequence[Tried]) -> list[Tried]:
    """Those of some candidates, best first, that are near the best."""
    first = tried[0].score if tried else 0.0
    return [one for one in tried if one.score > min(first - STRONG_SCORE, OF_THE_BEST * first)]


def fitted_near(model: Hypothesis, tried: Sequence[Tried], k: int) -> list[Hypothesis]:
    """The hypothesis with each of the candidates near the first, fitted in full, in the place of its term ``k``, or one
    more; where its size is plausible."""
    terms, near = model.terms, worth_fitting(tried)[:N_LEADERS]
    fewer = model.without[k] if near and k < len(terms) else model

    def fitted(one: Tried) -> Hypothesis:
        # Noise strengths of a rival begin where those of the term begin: the search along them ends near its start.
        strengths = one.asked.strengths if k == len(terms) else None
        return again(model, [*terms[:k], as_fits_best(fewer, one), *terms[k + 1 :]], strengths=strengths)

    made = side_by_side(fitted, near)
    return [one for one in made if one.terms[k].effect.is_plausible(one.terms[k].variant, *one.value(k))]


def with_best(model: Hypothesis, standing: Sequence[Tried]) -> tuple[Hypothesis, Term | None]:
    """The hypothesis with the best of the candidates near the first, each fitted in full."""
    made = fitted_near(model, standing, len(model.terms))
    best = max(made, key=lambda one: one.score(-1), default=None)
    return (model, None) if best is None else (best, best.terms[-1])


# Shape parameters of an effect (a time constant, a delay): fitted, then carried as unknowns.

SHAPE_STEPS = 0.6 * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
"""Steps of the logarithm of a shape parameter about the grid's best, to which a parabola is fitted."""
N_ROUNDS = 2
"""Fixed-point iterations of size, shape and columns: effects are about 10⁻³ of the motion, so two leave an error of
their square."""
GRID_STEP = math.log(2.5)
"""Usual distance between two values of a grid, as a logarithm."""


def as_fits_best(model: Hypothesis, tried: Tried) -> Term:
    """A candidate with its columns computed for its fitted size, at its shape of maximum evidence."""
    term, asked = tried.term, tried.asked
    for _ in range(N_ROUNDS):
        made = term.effect.rescaled(model.context, term.variant, asked.value)
        if made is None:
            break
        term = term.of_size(model.context, made)
        asked = model.with_added([term])[0]
    return _reshaped(model, term)


def _reshaped(model: Hypothesis, term: Term) -> Term:
    """A term at the shape parameter of maximum evidence, with the standard uncertainty from the curvature."""
    if len(term.variant.shape) != 1:
        return term
    ((name, (value, unit)),) = term.variant.shape.items()
    if term.effect.reshaped(model.context, term.variant, value) is None:
        return term
    spread, sigma = 1.0, np.inf
    for _ in range(N_ROUNDS):
        steps = spread * SHAPE_STEPS
        made = [term.effect.reshaped(model.context, term.variant, value * float(np.exp(step))) for step in steps]
        asked = model.with_added([replace(term, variant=v) for v in made if v is not None])
        gain = np.array([one.log_evidence for one in asked])
        a, b, _ = np.polyfit(steps, gain, 2)
        if a < 0.0:
            value *= float(np.exp(np.clip(-b / (2.0 * a), steps[0], steps[-1])))
            sigma = float(np.sqrt(-0.5 / a))
            spread = float(np.clip(2.0 * sigma, 0.1, 1.0))
        else:
            value *= float(np.exp(steps[gain.argmax()]))
    final = term.effect.reshaped(model.context, term.variant, value)
    if final is None:
        return term
    # The evidence is at its maximum over the shape, which pays for its place between two values of the grid.
    cost = term.cost + 2.0 * max(math.log(GRID_STEP) - math.log(math.sqrt(2.0 * math.pi) * sigma), 0.0)
    variant = replace(final, shape={name: (value, unit)}, shape_sigma=abs(value) * min(sigma, 10.0))
    return replace(term, variant=variant, cost=cost)


def renewed(model: Hypothesis) -> Hypothesis:
    """The hypothesis with the columns of its own motion, for effects of the true motion: those of the search were
    computed from readings that contained the effect, and with the S that was fitted without it."""
    if any(term.effect.is_of_true_motion for term in model.terms):
        for _ in range(N_ROUNDS):
            model = again(model, [_renewed(model, term) for term in model.terms])
    return model


def _renewed(model: Hypothesis, term: Term) -> Term:
    if not term.effect.is_of_true_motion:
        return term
    known = term.variant.label, term.variant.names
    return replace(term, variant=next(v for v in term.effect.variants(model.context) if (v.label, v.names) == known))


def with_shapes(model: Hypothesis) -> Hypothesis:
    """The hypothesis with its shape parameters as unknowns: one more column each, p D'(ln shape).

    With fixed shapes the uncertainties of S, b and p would be too small.
    """
    more = [term for k in range(len(model.terms)) if (term := _by_shape(model, k)) is not None]
    return again(model, [*model.terms, *more]) if more else model


def _by_shape(model: Hypothesis, k: int) -> Term | None:
    term = model.terms[k]
    if term.variant.shape_sigma <= 0.0 or len(term.variant.shape) != 1:
        return None
    ((_, (value, _)),) = term.variant.shape.items()
    # The difference quotient over the standard error of its logarithm, as far as the shape was tried.
    step = min(term.variant.shape_sigma / abs(value), float(SHAPE_STEPS[-1]))
    made = [term.effect.reshaped(model.context, term.variant, value * float(np.exp(s))) for s in (-step, step)]
    if made[0] is None or made[1] is None:
        return None
    size, _ = model.value(k)
    low, high = made[0].distortion, made[1].distortion

    def slope(name: str) -> FloatArray | None:
        a, b = getattr(low, name), getattr(high, name)
        return None if a is None else ((b - a) @ size / (2.0 * step))[:, :, None]

    columns = Distortion(slope("force"), slope("rate"))
    return Term(term.effect, Variant(columns, ("shape",), ("1",), label="shape"), np.ones(1))
