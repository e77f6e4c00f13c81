"""Several recordings of one unit: effects of the instrument with one common size, by their joint evidence (eq. 11.21).

Bias, S and noise strengths are those of each recording; the likelihoods of an effect's parameters add.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.candidates import N_LEADERS, offered_beside, price_of_choice, terms_of
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.bias_process import BiasProcess
from trihedron.diagnose.effects.contract import PRIOR_SCALES, DirectEffect, Effect
from trihedron.diagnose.hypothesis import AddedTerms, Hypothesis, Likelihood, Term, again
from trihedron.diagnose.search import threshold
from trihedron.probability import chdtrc
from trihedron.records.diagnosis import EffectParameter, SharedCandidate, SharedEffect


def agreement(parts: Sequence[Likelihood]) -> float:
    """p-value of the differences between the recordings' sizes of one effect (χ², no prior)."""
    dof, chi2 = np.sum([_determined(one) for one in parts], axis=0) - _determined(sum(parts[1:], parts[0]))
    return chdtrc(dof, max(chi2, 0.0)) if dof > 0 else 1.0


def _determined(one: Likelihood) -> FloatArray:
    """Number of the directions that a likelihood determines, beyond rounding, and its square along them."""
    values, vectors = np.linalg.eigh(one.precision)
    known = values > np.sqrt(np.finfo(np.float64).eps) * values[-1]
    return np.array([known.sum(), ((one.slope @ vectors[:, known]) ** 2 / values[known]).sum()])


@dataclass(frozen=True, eq=False)
class _Joint:
    """One candidate in all recordings: its term and its likelihood in each, in units of ``unit``, over that without it;
    the prior scale of largest evidence and the score there."""

    terms: tuple[Term, ...]
    parts: tuple[Likelihood, ...]
    unit: FloatArray
    scale: float
    score: float

    @classmethod
    def of(cls, terms: tuple[Term, ...], asked: Sequence[AddedTerms], plain: Sequence[float]) -> _Joint:
        unit, scale = terms[0].sizes, terms[0].variant.scale
        # The columns of recordings may have different scales to the reported unit.
        parts = tuple(
            replace(a, log_evidence=a.log_evidence - p).likelihood(t.sizes, unit * scale / t.variant.scale)
            for a, t, p in zip(asked, terms, plain, strict=True)
        )
        made = [(sum(parts[1:], parts[0]).under(np.full(len(unit), by))[0], by) for by in PRIOR_SCALES]
        gain, best = max(made, key=lambda one: one[0])
        return cls(terms, parts, unit, best, 2.0 * gain - max(t.cost for t in terms))

    @property
    def id(self) -> str:
        return self.terms[0].effect.id

    def scored(self, part: Likelihood) -> tuple[float, tuple[EffectParameter, ...]]:
        """Score and parameters by one recording or by several."""
        term = self.terms[0]
        gain, value, covariance = part.under(np.full(len(self.unit), self.scale))
        parameters = term.effect.parameters(
            term.variant, value * self.unit, covariance * np.outer(self.unit, self.unit)
        )
        return 2.0 * gain - term.cost, parameters

    def record(self, alpha: float) -> SharedEffect:
        scores, each = zip(*(self.scored(part) for part in self.parts), strict=True)
        _, parameters = self.scored(sum(self.parts[1:], self.parts[0]))
        p_agree = agreement(self.parts)
        return SharedEffect(self.id, self.score, parameters, scores, each, p_agree, p_agree > alpha)


def may_be_shared(effect: Effect) -> bool:
    """Whether an effect belongs to the instrument and has columns, so that several recordings can share its size."""
    is_own = effect.of_session is None or effect.is_of_motion or effect.is_local or effect.is_spread
    return not (is_own or isinstance(effect, BiasProcess | DirectEffect))


def shared_effects(
    models: Sequence[Hypothesis], alpha: float
) -> tuple[tuple[SharedEffect, ...], tuple[SharedCandidate, ...]]:
    """Effects accepted for all recordings of one unit together, by the score of one common size; and all candidates.

    ``models`` are the results of each recording alone; effects that may be the instrument's are tested anew.
    """
    limit = threshold(alpha)
    bare = [again(m, [t for t in m.terms if not may_be_shared(t.effect)]) for m in models]
    shared: list[tuple[Term, ...]] = []
    while (tried := _tried(_beside(bare, shared))) and tried[0].score > limit:
        shared.append(tuple(term.scaled(tried[0].scale) for term in tried[0].terms))
    while True:
        judged = [_full(_beside(bare, [*shared[:k], *shared[k + 1 :]]), terms) for k, terms in enumerate(shared)]
        least = min(judged, key=lambda one: one.score, default=None)
        if least is None or least.score > limit:
            break
        shared.remove(least.terms)
    effects = tuple(one.record(alpha) for one in sorted(judged, key=lambda one: -one.score))
    named = {one.id for one in effects}
    return effects, tuple(SharedCandidate(one.id, one.score) for one in tried if one.id not in named)


def _beside(bare: Sequence[Hypothesis], shared: Sequence[tuple[Term, ...]]) -> list[Hypothesis]:
    """Every recording with its own effects, followed by the shared ones."""
    return [again(m, [*m.terms, *(terms[i] for terms in shared)]) for i, m in enumerate(bare)]


def _tried(models: Sequence[Hypothesis]) -> list[_Joint]:
    """Effects that can be added to the hypotheses of all recordings, best first, one shape each."""
    sought = [one for one in catalogue() if may_be_shared(one)]
    found = []
    for model in models:
        price = price_of_choice(model, catalogue())
        terms = [t for effect in offered_beside(model, sought, ()) for t in terms_of(model, effect, price)]
        kinds = ((t.variant.label, t.variant.names, tuple(sorted(t.variant.shape.items()))) for t in terms)
        found.append({(t.effect.id, *kind): t for t, kind in zip(terms, kinds, strict=True)})
    common = [tuple(one[key] for one in found) for key in found[0] if all(key in one for one in found)]
    if not common:
        return []
    looks = [m.at_its_strengths(terms, (1.0,)) for m, terms in zip(models, zip(*common, strict=True), strict=True)]
    plain = [m.log_evidence for m in models]
    glanced = (_Joint.of(terms, asked, plain) for terms, *asked in zip(common, *looks, strict=True))
    best = {one.id: one for one in sorted(glanced, key=lambda one: one.score)}
    first = sorted(best.values(), key=lambda one: -one.score)
    full = [_full(models, one.terms) for one in first[:N_LEADERS]]
    return sorted([*full, *first[N_LEADERS:]], key=lambda one: -one.score)


def _full(models: Sequence[Hypothesis], terms: tuple[Term, ...]) -> _Joint:
    """A candidate evaluated with the noise strengths of every recording refitted."""
    asked = [m.with_added([t])[0] for m, t in zip(models, terms, strict=True)]
    return _Joint.of(terms, asked, [m.plain([a.strengths]) for m, a in zip(models, asked, strict=True)])
