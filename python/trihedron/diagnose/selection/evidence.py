"""Effects that bring their own evidence: what their tests find joins the model one by one, each held to its promise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.selection.compare import held_out_records, mends
from trihedron.diagnose.selection.excess import explained
from trihedron.diagnose.selection.model import (
    Accepted,
    StepwiseModel,
    held_out,
    observed_with,
    on_observations,
    with_only,
)
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import tune_noise
from trihedron.diagnose.session.twin import stacked
from trihedron.records.diagnosis import Candidate


def with_evidence(
    model: StepwiseModel, alpha: float, *, is_late: bool = False
) -> tuple[StepwiseModel, dict[str, Candidate]]:
    """The model with every effect whose own test finds it, and what every such test said.

    ``is_late`` asks for those that are looked for in what the competition has left.
    """
    taken = {one.effect.id for one in model.accepted if not one.effect.repeatable} | (
        model.refused if is_late else set()
    )
    found, candidates = _looked_for(model.context, alpha, taken, is_late=is_late)
    for effect, evidence in found:
        model = _with_one(model, effect, evidence)
    return model, candidates


def spread_anew(model: StepwiseModel, alpha: float) -> StepwiseModel:
    """The model with zeros that scatter by what they do beside everything in it, and not by what was left before.

    Scatter was found in the rest of a model without what joined since; beside that it may be less, or nothing.
    """
    kept = []
    for one in model.accepted:
        if one.effect.is_spread and isinstance(one.effect, DirectEffect) and one.evidence is not None:
            evidence = one.effect.find(model.context)
            if evidence is None or not _is_seen(evidence, alpha):
                continue
            kept.append(replace(one, evidence=evidence))
        else:
            kept.append(one)
    return with_only(model, tuple(kept))


def _looked_for(
    context: Context, alpha: float, taken: set[str], *, is_late: bool
) -> tuple[list[tuple[DirectEffect, Evidence]], dict[str, Candidate]]:
    candidates: dict[str, Candidate] = {}
    found: list[tuple[DirectEffect, Evidence]] = []
    for effect in catalogue():
        if not isinstance(effect, DirectEffect) or effect.id in taken:
            continue
        if effect.is_late != is_late and not (is_late and effect.is_sought_again):
            continue
        reason = effect.unavailable(context)
        if reason is not None:
            candidates[effect.id] = Candidate(effect.id, None, False, reason)
            continue
        evidence = effect.find(context)
        if not effect.repeatable or evidence is not None:
            candidates[effect.id] = Candidate(effect.id, 1.0 if evidence is None else evidence.p_value, True)
        if evidence is not None and _is_seen(evidence, alpha):
            found.append((effect, evidence))
    found.sort(key=lambda pair: (pair[0].precedence, -pair[1].strength))
    return found, candidates


def _is_seen(evidence: Evidence, alpha: float) -> bool:
    """Whether an effect's own test finds it; half of the rate of false alarms is theirs, half the competition's."""
    return evidence.p_value * len(catalogue()) < alpha / 2.0


def _with_one(model: StepwiseModel, effect: DirectEffect, evidence: Evidence) -> StepwiseModel:
    p_adjusted = min(1.0, evidence.p_value * len(catalogue()))
    gain = float(evidence.strength)
    after = model
    if evidence.reweigh is not None or evidence.variant is not None:
        obs = _observed(model, evidence)
        kept, known = model.accepted, model.fitted.twin.effect
        if (obs.move_ranges, obs.n_holds) != (model.obs.move_ranges, model.obs.n_holds):
            # Samples were put in or moves left out: columns made for the old ones do not fit the new.
            kept = on_observations(model, obs, kept)
            known = np.zeros(sum(one.variant.distortion.n_parameters for one in kept if one.variant is not None))
        added = [] if evidence.variant is None else [evidence.variant.distortion]
        distortion = stacked([*(one.variant.distortion for one in kept if one.variant is not None), *added])
        n_new = sum(d.n_parameters for d in added)
        start = replace(model.fitted.twin, effect=np.concatenate([known, np.zeros(n_new)]))
        fitted = tune_noise(obs, start, distortion, model.prior)
        after = replace(model, context=Context(obs, fitted), prediction=held_out(fitted), accepted=kept)
        if not effect.is_proof and not mends(
            model.fitted, model.prediction, fitted, after.prediction, evidence.touched
        ):
            return model.refusing(effect.id)
        gain = max(gain, explained(model.fitted, fitted))
        if evidence.restate is not None:
            evidence = replace(evidence, parameters=evidence.restate(after.context))
    held = evidence.held_out or held_out_records(model.fitted, model.prediction, after.fitted, after.prediction)
    one = Accepted(effect, evidence.variant, evidence, p_adjusted, gain, gain, held, evidence.confounded_with)
    return replace(after, accepted=(*after.accepted, one))


def _observed(model: StepwiseModel, evidence: Evidence) -> Observations:
    if evidence.reweigh is None:
        return model.obs
    if evidence.touched is None:
        return evidence.reweigh(model.obs)
    return observed_with(model.bare, [*(one.evidence for one in model.accepted if one.evidence is not None), evidence])
