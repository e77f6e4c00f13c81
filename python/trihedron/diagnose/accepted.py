"""Accepted effects, candidates and stages as the records that reports and files show."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.diagnose.bias_strengths import BiasStrength, explain_as_much
from trihedron.diagnose.candidates import Tried, wald_p
from trihedron.diagnose.effects import by_id, catalogue
from trihedron.diagnose.effects.contract import Effect, Evidence
from trihedron.diagnose.hypothesis import Hypothesis, held_out_records
from trihedron.diagnose.residuals.effect_curves import bias_curves, effect_curves
from trihedron.diagnose.residuals.goodness_of_fit import ROW_DOMAINS, ROW_UNITS
from trihedron.diagnose.search import Found
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Fit
from trihedron.probability import NORMAL_95
from trihedron.records.diagnosis import AcceptedEffect, Candidate, EffectCurve, EffectParameter, Stage, StageDomain
from trihedron.records.domains import DomainResiduals, DomainTest, HeldOut
from trihedron.records.words import words
from trihedron.session.model import misfits


@dataclass(frozen=True, eq=False)
class Answer:
    """Everything accepted: effects with columns, bias processes, effects found by tests on the samples.

    ``predicted`` and ``bare`` are the session without effects, noise bounded to the part's and of free strength.
    ``numbers`` is the hypothesis that parameters and uncertainties come from; its shape parameters are unknowns too.
    ``asked`` are all bias processes tested, ``tested`` the results of the samples' own tests; ``domains`` are those of
    the session without effects, ``remaining`` with them.
    """

    predicted: Fit
    bare: Hypothesis
    found: Found
    numbers: Hypothesis
    biases: Sequence[BiasStrength]
    seen: Mapping[str, Evidence]
    judged: Fit
    """Fit with all accepted effects, noise strengths bounded to the part's noise; remaining misfit is judged on it."""
    asked: Mapping[str, BiasStrength]
    tested: Mapping[str, Candidate]
    domains: tuple[DomainTest, ...]
    remaining: tuple[DomainTest, ...] = ()

    @property
    def ids(self) -> set[str]:
        return {effect.id for effect, *_ in self.gains}

    @property
    def gains(self) -> list[tuple[Effect, float, float | None]]:
        """Every effect, its gain (twice a log-likelihood) and the share that its own test states, or ``None``."""
        return [
            *((term.effect, gain, None) for term, gain in zip(self.found.model.terms, self.found.gains, strict=True)),
            *((one.effect, one.gain, None) for one in self.biases),
            *((by_id()[key], one.strength, one.share) for key, one in self.seen.items()),
        ]

    @property
    def shares(self) -> list[float]:
        """Share of the misfit explained by each: its gain over the sum of all gains, of the relations beside them, and
        the remaining excess: χ² beyond the degrees of freedom, over the domains where it is positive."""
        chi2, dof = misfits(self.judged.core)
        whole = float(np.maximum(chi2 - dof, 0.0).sum()) + sum(one.score for one in self.found.related.relations)
        whole = max(whole + sum(max(gain, 0.0) for _, gain, own in self.gains if own is None), TINY)
        return [max(gain, 0.0) / whole if own is None else own for _, gain, own in self.gains]

    @property
    def says_why(self) -> bool:
        """Whether a mechanism was accepted, not a scatter or a disturbed pose alone, and an effect that is not minor: a
        faint line, or one of the samples that changes nothing in the fit; and relations explain less than the
        instrument's mechanisms do, and no more disagrees still than is explained."""
        left = {d.domain: d.excess for d in self.remaining}
        explained = sum(max(d.excess - left[d.domain], 0.0) for d in self.domains if d.domain in left)
        if sum(left[d.domain] for d in self.remaining if d.disagrees) > explained:
            return False
        # An arm and Earth rate are no faults that would stand in for what the instrument does; the strength of a bias
        # process states a size, not a cause.
        sizes = {one.effect.id for one in self.biases}
        of_instrument = sum(
            gain
            for effect, gain, _ in self.gains
            if not (effect.is_of_motion or effect.of_session or effect.id in sizes)
        )
        if sum(one.score for one in self.found.related.relations) > of_instrument:
            return False
        # What is seen in the samples and changes no observation: no gaps of time, no moves excluded.
        beside = {key for key, one in self.seen.items() if one.reweigh is None}
        is_faint = [own is not None or effect.is_minor or effect.id in beside for effect, _, own in self.gains]
        # One of single samples or poses says why if it explains more than everything else does.
        is_reason = [share >= 1.0 - share or not faint for share, faint in zip(self.shares, is_faint, strict=True)]
        return any(is_reason) and not all(effect.is_minor for effect, *_ in self.gains)


def accepted_effects(answer: Answer, residuals: Sequence[DomainResiduals]) -> tuple[AcceptedEffect, ...]:
    """Every accepted effect with its parameters: mechanisms by their share of the misfit of poses and moves, then what
    shows inside the poses alone, whose share is of another misfit, then minor effects.

    ``residuals`` of the poses, in the fit with all effects, are stored with each effect's curve.
    """
    made = [*_of_terms(answer, residuals), *_of_biases(answer, residuals), *_of_samples(answer)]
    each = [replace(record, share=share) for record, share in zip(made, answer.shares, strict=True)]
    return tuple(sorted(each, key=lambda one: (*place(one), -(one.share or 0.0))))


def place(one: AcceptedEffect) -> tuple[bool, bool]:
    """Mechanisms come first, then lines, then a scatter, what may as well be one, and what concerns one pose."""
    of, may_be_spread = by_id()[one.id], any(by_id()[rival].is_spread for rival in one.confounded_with)
    return of.is_minor or may_be_spread, of.is_of_samples


def _of_terms(answer: Answer, residuals: Sequence[DomainResiduals]) -> list[AcceptedEffect]:
    found, out = answer.found, []
    for k, term in enumerate(found.model.terms):
        effect, variant = term.effect, term.variant
        value, covariance = answer.numbers.value(k)
        parameters = effect.parameters(variant, value, covariance)
        columns = variant.distortion.force, variant.distortion.rate
        curves = () if effect.is_local else effect_curves(found.model.context, columns, value, covariance, residuals)
        out.append(effect_record(
            effect, parameters, effect.statement(parameters), wald_p(value, covariance), found.scores[k],
            held_out_records(found.without[k], found.model), found.rivals[k], curves,
            variant=variant.label, shape={name: v for name, (v, _) in variant.shape.items()},
            values=[float(v) for v in value],
        ))  # fmt: skip
    return out


def _of_biases(answer: Answer, residuals: Sequence[DomainResiduals]) -> list[AcceptedEffect]:
    model, out = answer.found.model, []
    for one in answer.biases:
        extra: dict[str, Any] = {}
        curves: tuple[EffectCurve, ...] = ()
        if one.effect.walks:
            path = one.alone.fitted.bias(one.effect.sensor)
            extra = series_of(model.obs, path, one.std, one.effect.unit)
            curves = bias_curves(model.context, one.effect.sensor, path, one.std, residuals)
        held = held_out_records(one.without, model)
        as_much = explain_as_much(one, model, answer.found.tried.values())
        rivals = (*one.rivals, *(other.term.effect.id for other in as_much))
        out.append(
            effect_record(
                one.effect, one.parameters, one.statement, one.p_value, one.score, held, rivals, curves, **extra
            )
        )
    return out


def _of_samples(answer: Answer) -> list[AcceptedEffect]:
    out = []
    for key, said in answer.seen.items():
        parameters = said.parameters if said.restate is None else said.restate(answer.numbers.context)
        out.append(effect_record(by_id()[key], parameters, said.statement, said.p_value, said.strength, said.held_out))
    return out


def series_of(obs: Observations, path: FloatArray, sigma: FloatArray, unit: str) -> dict[str, Any]:
    """The curve of a drifting bias, ``path`` (poses, 3) with standard uncertainties (3,), as the result states it."""
    times, errors = obs.pose_time_s.tolist(), [[float(s)] * len(path) for s in sigma]
    return {"curve": {"time_s": times, "value": path.T.tolist(), "sigma": errors, "unit": unit}}


def effect_record(
    effect: Effect,
    parameters: tuple[EffectParameter, ...],
    statement: str,
    p_value: float,
    score: float,
    held_out: tuple[HeldOut, ...],
    rivals: tuple[str, ...] = (),
    curves: tuple[EffectCurve, ...] = (),
    **model: Any,
) -> AcceptedEffect:
    either = (effect, by_id()[rivals[0]]) if rivals else ()
    said = {"variant": "", "shape": {}, "values": [], **model, "applies_to_other_recordings": effect.applies_elsewhere}
    return AcceptedEffect(
        id=effect.id, statement=statement, parameters=parameters,
        p_adjusted=min(1.0, max(p_value, TINY) * len(catalogue())), delta_bic=float(score), held_out=held_out,
        confounded_with=rivals,
        separating_experiment="; or ".join(dict.fromkeys(e for one in either if (e := one.separating_experiment()))),
        model=MappingProxyType(said), curves=curves,
    )  # fmt: skip


def held_out_stages(answer: Answer) -> tuple[Stage, ...]:
    """The recording predicted by the linear parameters and, where effects were accepted, by parameters and effects."""
    stages = (Stage("parameters", _stage(answer.bare)),)
    return (*stages, Stage("effects", _stage(answer.found.model))) if answer.ids else stages


def _stage(model: Hypothesis) -> tuple[StageDomain, ...]:
    return tuple(StageDomain(ROW_DOMAINS[d], *of, ROW_UNITS[d]) for d, of in sorted(model.held_out.items()))


def candidates(answer: Answer) -> tuple[Candidate, ...]:
    """Every effect tried, accepted or not: score, size, upper limit, and the effect that took its place."""
    found, out = answer.found, dict(answer.tested)
    out |= {key: Candidate(key, None, False, reason) for key, reason in found.missing.items() if key not in out}
    for key, one in found.tried.items():
        reason = words("relation-instead") if found.related.relations and one.score > 0.0 else ""
        reason = words("held-out-worse") if key in found.dropped else reason
        out[key] = tried_candidate(one, found.against.get(key), reason)
    for key, bias in answer.asked.items():
        if key not in out or bias.score > (out[key].score or -np.inf):
            limit = bias.size + NORMAL_95 * bias.std
            reason = words("within-flicker") if bias.score > 0.0 and not bias.is_large else ""
            against = next((one.effect.id for one in answer.biases if key in one.rivals), None)
            said = bias.score, bias.parameters, float(np.max(limit)), against
            out[key] = Candidate(key, bias.p_value, True, reason, *said)
    for k, term in enumerate(found.model.terms):
        value, covariance = answer.numbers.value(k)
        size = term.effect.parameters(term.variant, value, covariance)
        out[term.effect.id] = Candidate(term.effect.id, wald_p(value, covariance), True, "", found.scores[k], size)
    return tuple(out[key] for key in sorted(out))


def tried_candidate(one: Tried, against: str | None, reason: str) -> Candidate:
    # A prior that was narrowed for its evidence would bound the size by itself.
    term, asked = one.term, one.asked.with_prior(one.term.sizes, one.term.sizes / min(one.term.scale, 1.0))
    size = term.effect.parameters(term.variant, asked.value, asked.covariance)
    # A parameter reported in another unit (an angle for a direction) has no upper limit here.
    linear = [p for p in size if p.name in term.variant.names and p.unit == size[0].unit]
    limit = max((abs(p.value) + NORMAL_95 * p.std for p in linear), default=None)
    return Candidate(term.effect.id, one.p_value, True, reason, one.score, size, limit, against)
