"""Several recordings of one unit: effects of the instrument with one common size, by their joint evidence (eq. 11.21).

The likelihood of an effect's parameters in one recording, everything else integrated out, is Gaussian: a constant, a
slope and a precision. These add over recordings. Bias, S and noise strengths are those of each recording.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.candidates import N_LEADERS, offered_beside, price_of_choice, terms_of
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.bias_process import BiasProcess
from trihedron.diagnose.effects.contract import PRIOR_SCALES, DirectEffect, Effect
from trihedron.diagnose.hypothesis import AddedTerms, Hypothesis, Term, again
from trihedron.diagnose.search import threshold
from trihedron.probability import chdtrc
from trihedron.records.diagnosis import EffectParameter, SharedCandidate, SharedEffect


@dataclass(frozen=True, eq=False)
class Information:
    """Likelihood of parameters ``q`` in one recording, in units of their expected size: a log-likelihood
    ``constant + slope·q - q·precision·q/2``, relative to that without the effect."""

    constant: float
    slope: FloatArray
    precision: FloatArray

    @classmethod
    def of(cls, asked: AddedTerms, term: Term, unit: FloatArray, plain: float) -> Information:
        """From the posterior under a prior of standard deviations ``term.sizes``; ``unit`` is the unit of ``q``."""
        posterior = np.linalg.inv(asked.covariance / np.outer(unit, unit))
        prior = np.diag((unit / term.sizes) ** 2)
        slope = posterior @ (asked.value / unit)
        # Rounding can make the precision of an undetermined direction negative.
        values, vectors = np.linalg.eigh(posterior - prior)
        precision = (vectors * np.maximum(values, 0.0)) @ vectors.T
        gain = asked.log_evidence - plain
        odds = 0.5 * (np.linalg.slogdet(posterior)[1] - np.linalg.slogdet(prior)[1])
        return cls(gain - 0.5 * float(slope @ np.linalg.solve(posterior, slope)) + float(odds), slope, precision)


def together(parts: Sequence[Information], scale: float) -> tuple[float, FloatArray, FloatArray]:
    """Log-evidence gained by one common ``q`` with prior standard deviation ``scale``; ``q`` and its covariance."""
    precision = sum((one.precision for one in parts), np.eye(len(parts[0].slope)) / scale**2)
    slope = np.sum([one.slope for one in parts], axis=0)
    covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    odds = 0.5 * np.linalg.slogdet(covariance / scale**2)[1]
    value: FloatArray = covariance @ slope
    return sum(one.constant for one in parts) + 0.5 * float(slope @ value) + float(odds), value, covariance


def agreement(parts: Sequence[Information]) -> float:
    """p-value of the differences between the recordings' sizes of one effect (χ², no prior)."""
    slope, precision = np.sum([p.slope for p in parts], axis=0), np.sum([p.precision for p in parts], axis=0)
    every = np.array([_determined(one.slope, one.precision) for one in parts]).sum(axis=0)
    dof, chi2 = every - _determined(slope, precision)
    return chdtrc(dof, max(chi2, 0.0)) if dof > 0 else 1.0


def _determined(slope: FloatArray, precision: FloatArray) -> tuple[float, float]:
    """Number of the directions that a likelihood determines, beyond rounding, and its square along them."""
    values, vectors = np.linalg.eigh(precision)
    known = values > np.sqrt(np.finfo(np.float64).eps) * values[-1]
    return float(known.sum()), float(((slope @ vectors[:, known]) ** 2 / values[known]).sum())


@dataclass(frozen=True, eq=False)
class _Joint:
    """One candidate in all recordings: its terms, its likelihood in each, and the score of a common size."""

    terms: tuple[Term, ...]
    parts: tuple[Information, ...]
    scale: float
    score: float
    value: FloatArray
    covariance: FloatArray

    @property
    def effect(self) -> Effect:
        return self.terms[0].effect


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
    shared, tried = _added(bare, limit)
    judged = [_judged(bare, shared, k, alpha) for k in range(len(shared))]
    while any(score <= limit for score, _ in judged):
        del shared[int(np.argmin([score for score, _ in judged]))]
        judged = [_judged(bare, shared, k, alpha) for k in range(len(shared))]
    effects = sorted((one for _, one in judged), key=lambda one: -one.score)
    named = {one.id for one in effects}
    candidates = tuple(SharedCandidate(j.effect.id, j.score) for j in tried if j.effect.id not in named)
    return tuple(effects), candidates


Shared = tuple[Term, ...]
"""One effect in every recording."""


def _beside(bare: Sequence[Hypothesis], shared: Sequence[Shared]) -> list[Hypothesis]:
    """Every recording with its own effects, followed by the shared ones."""
    return [again(m, [*m.terms, *(terms[i] for terms in shared)]) for i, m in enumerate(bare)]


def _added(bare: Sequence[Hypothesis], limit: float) -> tuple[list[Shared], list[_Joint]]:
    shared: list[Shared] = []
    while True:
        tried = _tried(_beside(bare, shared), {terms[0].effect.id for terms in shared})
        if not tried or tried[0].score <= limit:
            return shared, tried
        shared.append(tuple(term.scaled(tried[0].scale) for term in tried[0].terms))


def _judged(bare: Sequence[Hypothesis], shared: Sequence[Shared], k: int, alpha: float) -> tuple[float, SharedEffect]:
    """The score of a shared effect beside all others, and its record."""
    joint = _full(_beside(bare, [*shared[:k], *shared[k + 1 :]]), shared[k])
    term, unit = joint.terms[0], joint.terms[0].sizes

    def parameters(value: FloatArray, covariance: FloatArray) -> tuple[EffectParameter, ...]:
        return term.effect.parameters(term.variant, value * unit, covariance * np.outer(unit, unit))

    alone = [together([part], joint.scale) for part in joint.parts]
    p_agree = agreement(joint.parts)
    return joint.score, SharedEffect(
        term.effect.id, joint.score, parameters(joint.value, joint.covariance),
        tuple(2.0 * gain - term.cost for gain, *_ in alone),
        tuple(parameters(value, covariance) for _, value, covariance in alone), p_agree, p_agree > alpha,
    )  # fmt: skip


def _tried(models: Sequence[Hypothesis], exclude: Collection[str]) -> list[_Joint]:
    """Effects that can be added to the hypotheses of all recordings, best first, one shape each."""
    sought = [one for one in catalogue() if may_be_shared(one)]
    found = []
    for model in models:
        offered, price = offered_beside(model, sought, exclude), price_of_choice(model, catalogue())
        found.append({_key(t): t for effect in offered for t in terms_of(model, effect, price)})
    common = [key for key in found[0] if all(key in one for one in found)]
    if not common:
        return []
    terms = {key: tuple(one[key] for one in found) for key in common}
    looks = [m.at_its_strengths([terms[key][i] for key in common], (1.0,)) for i, m in enumerate(models)]
    plain = [m.log_evidence for m in models]
    glanced = (_joint(terms[key], asked, plain) for key, *asked in zip(common, *looks, strict=True))
    best = {one.effect.id: one for one in sorted(glanced, key=lambda one: one.score)}
    first = sorted(best.values(), key=lambda one: -one.score)
    full = [_full(models, one.terms) for one in first[:N_LEADERS]]
    return sorted([*full, *first[N_LEADERS:]], key=lambda one: -one.score)


def _key(term: Term) -> tuple[object, ...]:
    return term.effect.id, term.variant.label, term.variant.names, tuple(sorted(term.variant.shape.items()))


def _full(models: Sequence[Hypothesis], terms: tuple[Term, ...]) -> _Joint:
    """A candidate evaluated with the noise strengths of every recording refitted."""
    asked = [m.with_added([t])[0] for m, t in zip(models, terms, strict=True)]
    return _joint(terms, asked, [m.plain([a.strengths]) for m, a in zip(models, asked, strict=True)])


def _joint(terms: tuple[Term, ...], asked: Sequence[AddedTerms], plain: Sequence[float]) -> _Joint:
    unit = terms[0].sizes
    # The columns of recordings may have different scales to the reported unit.
    units = [unit * terms[0].variant.scale / t.variant.scale for t in terms]
    parts = tuple(Information.of(a, t, u, p) for a, t, u, p in zip(asked, terms, units, plain, strict=True))
    made = [(scale, *together(parts, scale)) for scale in PRIOR_SCALES]
    scale, gain, value, covariance = max(made, key=lambda one: one[1])
    return _Joint(terms, parts, scale, 2.0 * gain - max(t.cost for t in terms), value, covariance)
