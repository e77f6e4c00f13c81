"""Every effect of the catalogue added to a hypothesis: which gain, how much, at which size and shape (eq. 11.19)."""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.hypothesis import AddedTerms, AtStrengths, Hypothesis, Term, again
from trihedron.diagnose.session.solve import Distortion
from trihedron.probability import chdtrc

PRIOR_SCALES = (1.0, 0.3, 0.1)
"""Prior widths tried, as factors on the data-sheet size of an effect: parts of a kind differ tenfold."""
RESCALED = (3.0, 0.3)
"""Factors on the prior width at which candidates are evaluated again."""
N_LEADERS = 3
"""Effects of each screening at fixed noise strengths that are evaluated with noise strengths refitted."""
SHAPES_KEPT = 2
"""Shapes kept per effect, counted separately for those with a plausible and those with an implausible size."""
NEAR = 6.0
"""Difference of scores below which two explanations are named together: odds of twenty to one."""


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


def all_beside(model: Hypothesis) -> tuple[list[Tried], dict[str, str]]:
    """Every effect added to the hypothesis at its noise strengths; and the reasons why others do not apply."""
    terms, missing = terms_beside(model, ())
    return _best_of_each(terms, model.at_its_strengths(terms, PRIOR_SCALES), model.log_evidence), missing


def candidates_beside(model: Hypothesis, exclude: Collection[str]) -> tuple[list[Tried], dict[str, str]]:
    """Candidates to add to a hypothesis, best first, one per effect; and the reasons why others do not apply."""
    terms, missing = terms_beside(model, exclude)
    if not terms:
        return [], missing
    leading = _leaders(model, terms)
    asked = model.with_added(leading)
    # Columns that depend on the size (a delay) are computed again for the fitted size.
    sized = {
        k: replace(term, variant=made)
        for k, (term, one) in enumerate(zip(leading, asked, strict=True))
        if (made := term.effect.rescaled(model.context, term.variant, one.value)) is not None
    }
    for k, one in zip(sized, model.with_added(list(sized.values())), strict=True):
        leading[k], asked[k] = sized[k], one
    plain = model.plain([one.strengths for one in asked])
    # The screening at fixed noise strengths may have chosen a prior width that is too small or too large.
    terms = [replace(term, sizes=term.sizes * scale) for scale in (1.0, *RESCALED) for term in leading]
    under = [one.with_prior(t.sizes, t.sizes * s) for s in RESCALED for t, one in zip(leading, asked, strict=True)]
    return _best_of_each(terms, [*asked, *under], plain), missing


def _best_of_each(terms: Sequence[Term], asked: Sequence[AddedTerms], plain: float) -> list[Tried]:
    """The best shape with a plausible size of every effect, best effect first."""
    best: dict[str, Tried] = {}
    for term, one in zip(terms, asked, strict=True):
        score = 2.0 * (one.log_evidence - plain) - term.cost
        known = best.get(term.effect.id)
        is_plausible = term.effect.is_plausible(term.variant, one.value, one.covariance)
        if (known is None or score > known.score) and is_plausible:
            best[term.effect.id] = Tried(term, score, one)
    return sorted(best.values(), key=lambda one: -one.score)


def terms_beside(model: Hypothesis, exclude: Collection[str]) -> tuple[list[Term], dict[str, str]]:
    """Every shape of every effect that applies and is not included; and the reasons why others do not apply."""
    context = model.context
    held = {t.effect.id for t in model.terms if not t.effect.is_local} | set(exclude)
    places = {(t.effect.id, t.variant.label) for t in model.terms}
    reasons = {effect.id: effect.unavailable(context) for effect in catalogue()}
    terms, missing = [], {key: reason for key, reason in reasons.items() if reason is not None and key not in held}
    price = price_of_choice(reasons.values())
    for effect in catalogue():
        if effect.id in held or reasons[effect.id] is not None:
            continue
        variants = [v for v in effect.variants(context) if (effect.id, v.label) not in places]
        cost = price + 2.0 * float(np.log(max(len(variants), 1) * len(PRIOR_SCALES)))
        # A shape that represents a family, a filter of any order, needs odds of twenty to one beside plain ones.
        terms += [Term(effect, v, effect.sizes(context, v), cost + NEAR * v.is_family) for v in variants]
    return terms, missing


def price_of_choice(reasons: Iterable[str | None]) -> float:
    """Selection penalty of one effect, in twice a log-likelihood: 2 ln of the number of effects that apply. It is the
    same for all of them and independent of their order."""
    return 2.0 * float(np.log(max(sum(reason is None for reason in reasons), 1)))


def _leaders(model: Hypothesis, terms: list[Term]) -> list[Term]:
    """Candidates that gain most one linear step from the fit, at its noise strengths and others, at their best size."""
    looks = model.gains(terms, PRIOR_SCALES)
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


def _can_be(model: Hypothesis, term: Term, look: AtStrengths) -> bool:
    """Whether the size found in a look is plausible, or columns can be computed anew for that size."""
    effect = term.effect
    is_plausible = effect.is_plausible(term.variant, look.value, look.covariance)
    return is_plausible or effect.rescaled(model.context, term.variant, look.value) is not None


# Shape parameters of an effect (a time constant, a delay): fitted, then carried as unknowns.

SHAPE_STEPS = 0.6 * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
"""Steps of the logarithm of a shape parameter about the grid's best, to which a parabola is fitted."""
N_RESHAPED = 2
"""Iterations of size and shape: the second changes them by a tenth of what the first does."""
SAME_COLUMNS = 3e-3
"""Relative change of columns below which they are not computed again: sizes are known to some per cent."""
STEP_LOG = 0.02
"""Half-step of the numerical derivative by the logarithm of a shape parameter."""


def as_fits_best(model: Hypothesis, tried: Tried) -> Term:
    """A candidate with its columns computed for its fitted size, at its shape of maximum evidence."""
    term, asked = tried.term, tried.asked
    for _ in range(N_RESHAPED):
        made = term.effect.rescaled(model.context, term.variant, asked.value)
        if made is None:
            break
        term = replace(term, variant=made)
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
    for _ in range(N_RESHAPED):
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
    return replace(term, variant=replace(final, shape={name: (value, unit)}, shape_sigma=value * min(sigma, 10.0)))


def renewed(model: Hypothesis) -> Hypothesis:
    """The hypothesis with the columns of its own motion, for effects of the true motion: those of the search were
    computed from readings that contained the effect, and with the S that was fitted without it."""
    for _ in range(N_RESHAPED):
        terms = [_renewed(model, term) for term in model.terms]
        if all(new is old for new, old in zip(terms, model.terms, strict=True)):
            break
        model = again(model, terms)
    return model


def _renewed(model: Hypothesis, term: Term) -> Term:
    """A term with its columns computed from the motion of a hypothesis; the same one where they hardly change."""
    known = term.variant
    if not term.effect.is_of_true_motion:
        return term
    for made in term.effect.variants(model.context):
        if (made.label, made.names, made.scale) == (known.label, known.names, known.scale):
            pairs = zip(vars(made.distortion).values(), vars(known.distortion).values(), strict=True)
            change = max(float(np.linalg.norm(a - b) / np.linalg.norm(a)) for a, b in pairs if a is not None)
            return replace(term, variant=made) if change > SAME_COLUMNS else term
    return term


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
    made = [term.effect.reshaped(model.context, term.variant, value * float(np.exp(s))) for s in (-STEP_LOG, STEP_LOG)]
    if made[0] is None or made[1] is None:
        return None
    size, _ = model.value(k)
    low, high = made[0].distortion, made[1].distortion

    def slope(name: str) -> FloatArray | None:
        a, b = getattr(low, name), getattr(high, name)
        return None if a is None else ((b - a) @ size / (2.0 * STEP_LOG))[:, :, None]

    columns = Distortion(slope("force"), slope("rate"))
    return Term(term.effect, Variant(columns, ("shape",), ("1",), label="shape"), np.ones(1))
