"""Effects against those that might stand in their place, once everything else is in the model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.diagnose.selection.compare import Comparison, cost_of
from trihedron.diagnose.selection.model import Accepted, Alternative, StepwiseModel, with_only
from trihedron.diagnose.selection.prune import stands
from trihedron.diagnose.selection.stepwise import CONFOUNDED_DELTA_BIC, gives_way, head_start

MOST_ALTERNATIVES = 2
"""Alternatives tried for each effect: those that explained most when it was chosen."""


def chosen_again(model: StepwiseModel) -> StepwiseModel:
    """The model with every effect the best of those that explained much when it was chosen (eq. 8.11c).

    The first to be chosen is chosen in the noise of a model that lacks all that came later: zeros that scatter, say.
    Alternatives that explain as much now are named with it; one that explains more takes its place.
    """
    if sum(one.variant is not None or one.reobserves for one in model.accepted) <= 1:
        return model  # nothing has changed since
    changed = model
    for k, one in enumerate(model.accepted):
        if one.variant is not None and one.alternatives:
            changed = _best_in_place(changed, k)
    return changed


def _best_in_place(model: StepwiseModel, k: int) -> StepwiseModel:
    one = model.accepted[k]
    taken = {other.effect.id for other in model.accepted}
    without = with_only(model, tuple(other for j, other in enumerate(model.accepted) if j != k))
    first = sum(o.variant.distortion.n_parameters for o in model.accepted[:k] if o.variant is not None)
    assert one.variant is not None
    here = _against(without, model, one, first)
    best, rivals = (model, here), list(one.rivals)
    for other in [a for a in one.alternatives if a.effect.id not in taken][:MOST_ALTERNATIVES]:
        swapped = _swapped(model, k, other)
        if swapped is None:
            continue
        there = _against(without, swapped, swapped.accepted[k], first)
        # Compared over one rest, the smaller of each domain, as when they first competed.
        rest = np.minimum(best[1].stays, there.stays)
        ahead = there.ahead_of(best[1], rest)
        held, its = best[0].accepted[k].effect.id, other.effect.id
        needed = CONFOUNDED_DELTA_BIC * (gives_way(its, held) - gives_way(held, its))
        needed += head_start(there.variant, best[1].variant)
        if ahead > needed and stands(there, other.effect, without.context):
            if ahead < CONFOUNDED_DELTA_BIC:
                rivals.append(held)
            best = swapped, there
        elif ahead > -CONFOUNDED_DELTA_BIC or (
            there.equals(best[1], rest, CONFOUNDED_DELTA_BIC) and stands(there, other.effect, without.context)
        ):
            rivals.append(its)
    final, against = best
    chosen = final.accepted[k]
    named = tuple(dict.fromkeys(i for i in rivals if i != chosen.effect.id))
    if final is not model:
        chosen = replace(chosen, delta_bic=against.bic_gain, held_out=against.held_out())
    chosen = replace(chosen, rivals=named)
    if final is model and named == one.rivals:
        return model
    return replace(final, accepted=(*final.accepted[:k], chosen, *final.accepted[k + 1 :]))


def _swapped(model: StepwiseModel, k: int, other: Alternative) -> StepwiseModel | None:
    """The model with another effect in place of one; ``None`` where these observations do not show it."""
    if other.effect.unavailable(model.context) is not None:
        return None
    variant = other.effect.made_again(model.context, other.variant)
    if variant is None:
        return None
    new = replace(model.accepted[k], effect=other.effect, variant=variant, rank=other.rank, evidence=None)
    return with_only(model, (*model.accepted[:k], new, *model.accepted[k + 1 :]))


def _against(without: StepwiseModel, model: StepwiseModel, one: Accepted, first: int) -> Comparison:
    assert one.variant is not None
    cost = cost_of(model.fitted, one.rank, len(one.variant.shape))
    return Comparison(
        one.variant, one.effect.is_local, without.fitted, without.prediction, model.fitted, cost, first,
        model.prediction,
    )  # fmt: skip
