"""A hypothesis: a session fitted with some effects and free noise strengths, and its evidence (eq. 11.18)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from trihedron.arrays import TINY, FloatArray, sigmas_of
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant
from trihedron.diagnose.residuals.goodness_of_fit import ROW_DOMAINS, ROW_UNITS, physical_rms
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Distortion, Fit, folds, solved, stacked
from trihedron.records.domains import HeldOut
from trihedron.session.model import DYNAMICS, MOVES, NOTHING, STATIC_ACCEL, STATIC_GYRO, Prior, SessionState
from trihedron.session.noise import ANYTHING, START_STRENGTHS, Bounds, Strengths, strengths_of_all
from trihedron.threads import side_by_side

ELSEWHERE = (
    strengths_of_all(640.0),
    strengths_of_all(300.0, scatter=3.0, between=0.5, moves=2.0),
    strengths_of_all(2.0, moves=5.0),
)
"""Low noise, biases that scatter, biases that walk: large noise strengths can absorb an effect that these show."""

OWN_DOMAINS = {"force": (STATIC_ACCEL, DYNAMICS), "rate": (STATIC_GYRO, MOVES, DYNAMICS)}
"""Row domains of one sensor's effects. Velocity depends on both sensors: a tilt error adds a component of gravity."""


@dataclass(frozen=True, eq=False)
class Term:
    """One effect of a hypothesis: its columns, the prior σ of each parameter, and ``cost``, the correction for its
    choice among shapes and effects, in twice a log-likelihood. The prior is ``scale`` times that of data sheets."""

    effect: Effect
    variant: Variant
    sizes: FloatArray
    cost: float = 0.0
    scale: float = 1.0

    def scaled(self, by: float) -> Term:
        """The effect with a prior so many times as wide."""
        return replace(self, sizes=self.sizes * by, scale=self.scale * by)

    def of_size(self, context: Context, variant: Variant) -> Term:
        """The effect with columns computed for another size; its prior is the same in physical units."""
        return replace(self, variant=variant, sizes=self.scale * self.effect.sizes(context, variant))

    @property
    def distortion(self) -> Distortion:
        """What it adds to the readings, per unit of each parameter."""
        return self.variant.distortion


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Likelihood of parameters ``q``, everything else integrated out: a log-likelihood
    ``constant + slope·q - q·precision·q/2``. Those of several recordings add (eq. 11.21)."""

    constant: float
    slope: FloatArray
    precision: FloatArray

    def __add__(self, other: Likelihood) -> Likelihood:
        constant, slope = self.constant + other.constant, self.slope + other.slope
        return Likelihood(constant, slope, self.precision + other.precision)

    def under(self, sizes: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Log-evidence under prior σ ``sizes`` (k,); ``q`` and its covariance."""
        covariance = np.asarray(np.linalg.inv(self.precision + np.diag(sizes**-2.0)), dtype=np.float64)
        value: FloatArray = covariance @ self.slope
        odds = 0.5 * np.linalg.slogdet(covariance / np.outer(sizes, sizes))[1]
        return self.constant + 0.5 * float(self.slope @ value) + float(odds), value, covariance


@dataclass(frozen=True, eq=False)
class AddedTerms:
    """Result of adding columns to a hypothesis, one linear step from its fit, noise strengths refitted.

    ``log_evidence`` with everything but the strengths integrated out, at the ``strengths`` that make it largest;
    ``value`` (k,) and ``covariance`` (k, k) of the new parameters.
    """

    log_evidence: float
    strengths: Strengths
    value: FloatArray
    covariance: FloatArray

    def likelihood(self, known: FloatArray, unit: FloatArray) -> Likelihood:
        """The likelihood, of a result under prior σ ``known`` (k,), of the parameters in a ``unit`` (k,)."""
        prior, scales = np.diag((unit / known) ** 2), np.outer(unit, unit)
        posterior = np.asarray(np.linalg.inv(self.covariance / scales), dtype=np.float64)
        slope = posterior @ (self.value / unit)
        odds = 0.5 * (np.linalg.slogdet(posterior)[1] - np.linalg.slogdet(prior)[1])
        constant = self.log_evidence - 0.5 * float(slope @ (self.value / unit)) + float(odds)
        return Likelihood(constant, slope, posterior - prior)

    def with_prior(self, known: FloatArray, other: FloatArray) -> AddedTerms:
        """The result under prior σ ``other`` (k,) in place of ``known`` (k,), at the same strengths."""
        gain, value, covariance = self.likelihood(known, known).under(other / known)
        return AddedTerms(gain, self.strengths, value * known, covariance * np.outer(known, known))


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A session fitted with the effects of its ``terms``; its noise strengths are bounded by ``within``."""

    terms: tuple[Term, ...]
    fitted: Fit
    within: Bounds = ANYTHING

    @property
    def obs(self) -> Observations:
        return self.fitted.obs

    @property
    def log_evidence(self) -> float:
        """Log-likelihood with everything but the noise strengths integrated out, up to a constant."""
        return self.fitted.core.log_marginal

    @property
    def strengths(self) -> Strengths:
        """Corner times [s], scatter and its departure during moves in their units, factors on the noise of moves."""
        return self.fitted.core.strengths

    @cached_property
    def context(self) -> Context:
        """The signals that effects are computed from, in this fit."""
        return Context(self.fitted)

    @cached_property
    def held_out(self) -> dict[int, tuple[float, float]]:
        """Rms [SI] and χ² per row of every domain that has rows, of blocks of poses or moves predicted from all others
        (blocked cross-validation, eq. 11.15). The rms is of innovations over each row's own noise alone, so that a
        model with a wider prediction does not look better in physical units.

        The training rows do not determine the vertical and biases of a held-out pose. A weak prior (its column scale)
        makes them finite; it is the same for every model that is compared.
        """
        chi2, _, n_rows, _, innovation = self.fitted.core.held_out(folds(self.fitted))
        rms, each = physical_rms(self.fitted, innovation), chi2.sum(axis=0)
        return {d: (rms[d], float(each[d] / n_rows[d])) for d in rms if n_rows[d] > 0.0}

    @cached_property
    def without(self) -> tuple[Hypothesis, ...]:
        """The hypothesis without each of its terms."""
        terms = self.terms
        return tuple(side_by_side(lambda k: again(self, [*terms[:k], *terms[k + 1 :]]), range(len(terms))))

    def gain_over(self, other: Hypothesis) -> float:
        """Twice the log-evidence that it gains over another."""
        return 2.0 * (self.log_evidence - other.log_evidence)

    def score(self, k: int) -> float:
        """Twice the log-evidence, less the correction for the choice of term ``k``: among others in its place."""
        return 2.0 * self.log_evidence - self.terms[k].cost

    def with_added(self, terms: Sequence[Term], within: Bounds | None = None) -> list[AddedTerms]:
        """Evidence of the hypothesis with each of some terms added, noise strengths refitted ``within`` bounds."""
        bounds, asked = self.within if within is None else within, [_column(t.distortion, t.sizes) for t in terms]
        found = self.fitted.core.evidence(asked, [self.strengths, *ELSEWHERE], bounds)
        return [AddedTerms(*one) for one in found]

    def gains(self, terms: Sequence[Term], scales: Sequence[float]) -> list[tuple[FloatArray, AddedTerms]]:
        """Gain (prior scales, strengths) in log-evidence over this hypothesis of each of some terms added, at the
        strengths found and at ``ELSEWHERE``, prior sizes times ``scales``; and its result at the strengths found and
        their best scale."""
        wholes: dict[int, tuple[Distortion, FloatArray, list[list[int]], list[int]]] = {}
        for k, term in enumerate(terms):
            whole, part = term.variant.part_of or (term.distortion, range(term.distortion.n_parameters))
            _, sizes, parts, own = wholes.setdefault(id(whole), (whole, np.ones(whole.n_parameters), [], []))
            sizes[list(part)] = term.sizes
            parts.append(list(part))
            own.append(k)
        asked = [_column(whole, sizes) for whole, sizes, *_ in wholes.values()]
        parts_of_each = [parts for *_, parts, _ in wholes.values()]
        strengths = [self.strengths, *ELSEWHERE]
        found = self.fitted.core.candidate_gains(asked, list(scales), strengths, parts_of_each)
        order = [k for *_, own in wholes.values() for k in own]
        out = sorted(zip(order, found, strict=True), key=lambda pair: pair[0])
        at = self.log_evidence, self.strengths
        return [(gain, AddedTerms(at[0] + float(gain[:, 0].max()), at[1], *said)) for _, (gain, *said) in out]

    def at_its_strengths(self, terms: Sequence[Term], scales: Sequence[float]) -> list[AddedTerms]:
        """As :meth:`with_added` at the noise strengths found: evidence with prior sizes times the best of ``scales``,
        parameters under the prior itself."""
        out = []
        for term, (gain, found) in zip(terms, self.gains(terms, scales) if terms else [], strict=True):
            own = found.with_prior(term.sizes * scales[int(gain[:, 0].argmax())], term.sizes)
            out.append(replace(own, log_evidence=found.log_evidence))
        return out

    def plain(self, strengths: Sequence[Strengths]) -> float:
        """Log-evidence without another term, noise strengths refitted from each of ``strengths``."""
        ((found, *_),) = self.fitted.core.evidence([NOTHING], [self.strengths, *strengths], self.within)
        return max(self.log_evidence, float(found))

    def value(self, k: int) -> tuple[FloatArray, FloatArray]:
        """Parameters of term ``k`` and their covariance."""
        covariance, n = self.fitted.covariance(), self.fitted.distortion.n_parameters
        first = n - sum(term.distortion.n_parameters for term in self.terms[k:])
        at = slice(first, first + self.terms[k].distortion.n_parameters)
        own = covariance[len(covariance) - n :, len(covariance) - n :]
        return self.fitted.state.effect[at], own[at, at]

    def is_shown(self, without: Hypothesis, k: int) -> bool:
        """Whether a parameter of term ``k`` exceeds its own σ and the held-out rms [SI] falls in one of its domains."""
        value, covariance = self.value(k)
        if not (np.abs(value) > sigmas_of(covariance)).any():
            return False
        before, after = without.held_out, self.held_out
        changed = [own for side, own in OWN_DOMAINS.items() if getattr(self.terms[k].distortion, side) is not None]
        return any(after[d][0] < before[d][0] for own in changed for d in own if d in after and d in before)


def _column(distortion: Distortion, sizes: FloatArray) -> tuple[FloatArray | None, FloatArray | None, list[float]]:
    return distortion.force, distortion.rate, sizes.tolist()


def hypothesis(
    obs: Observations,
    start: SessionState,
    prior: Prior | None,
    terms: Sequence[Term] = (),
    within: Bounds = ANYTHING,
    strengths: Strengths = START_STRENGTHS,
) -> Hypothesis:
    """The session fitted with some effects, alternating with its noise strengths of maximum evidence."""
    distortion = stacked([term.distortion for term in terms])
    sizes = np.concatenate([term.sizes for term in terms]) if terms else np.zeros(0)
    fitted = solved(obs, start, prior, distortion, strengths, within, sizes)
    return Hypothesis(tuple(terms), fitted, within)


def again(
    known: Hypothesis, terms: Sequence[Term], within: Bounds | None = None, strengths: Strengths | None = None
) -> Hypothesis:
    """The same observations fitted with other effects or bounds, started from the known fit, or from other
    ``strengths``."""
    within = known.within if within is None else within
    return hypothesis(known.obs, known.fitted.state, known.fitted.prior, terms, within, strengths or known.strengths)


def held_out_records(before: Hypothesis, after: Hypothesis) -> tuple[HeldOut, ...]:
    """Held-out chi-square per row and rms [SI] of two hypotheses, per domain, the largest decrease of the rms first."""
    out = []
    for d in before.held_out.keys() & after.held_out.keys():
        (was, _), (now, left) = before.held_out[d], after.held_out[d]
        fall = max(was, TINY) / max(now, TINY)
        # Both use the noise strengths of ``after``: those fitted without the effect absorb part of what it explains.
        before_over_it = left * (was / max(now, TINY)) ** 2
        out.append((-fall, d, HeldOut(ROW_DOMAINS[d], before_over_it, left, was, now, ROW_UNITS[d])))
    return tuple(held for *_, held in sorted(out, key=lambda one: one[:2]))
