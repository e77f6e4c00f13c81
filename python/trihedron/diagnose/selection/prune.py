"""Backward elimination: everything accepted is judged once more beside everything else, the weakest first."""

from __future__ import annotations

from dataclasses import replace

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect
from trihedron.diagnose.selection.compare import (
    Comparison,
    cost_of,
    held_out_records,
    mends,
    own_domains,
)
from trihedron.diagnose.selection.excess import domain_chi2, explained, in_the_scatter_of
from trihedron.diagnose.selection.model import Accepted, StepwiseModel, with_only
from trihedron.diagnose.selection.stepwise import is_sound
from trihedron.diagnose.session.twin import DYNAMICS, MOVES, STATIC_ACCEL, STATIC_GYRO, Distortion

LEAST_SHARE = 0.5
"""Of the misfit in the domain that it helps most an effect must remove this share, all else being in the model: what
removes less is the least bad guess at a mechanism that is not in the catalogue. Set where wrong answers of
benches/blind.py --foreign 15 --seed 5 and right ones of benches/blind_nuisances.py part; those seeds are no test."""
COMPARABLE = 0.25
"""Share of the largest fall of chi-square from which another domain may speak for the effect."""
AGREES = 1.5
"""Chi-square per degree of freedom at which a domain holds so little misfit that no share of it is asked for."""


def judged_again(model: StepwiseModel) -> StepwiseModel:
    """The model without the effects that what came after them has made needless, with every gain as it now stands.

    One goes at a time, the one with least to show, and the others are judged anew without it: none pays for another.
    """
    while True:
        judged = [_judged(model, k) for k in range(len(model.accepted))]
        failed = [k for k, (_, held_up) in enumerate(judged) if not held_up]
        if not failed:
            return replace(model, accepted=tuple(one for one, _ in judged))
        weakest = min(failed, key=lambda k: judged[k][0].delta_bic)
        effect_id = model.accepted[weakest].effect.id
        model = with_only(model, tuple(one for k, one in enumerate(model.accepted) if k != weakest))
        model = model.refusing(effect_id)


def _judged(model: StepwiseModel, k: int) -> tuple[Accepted, bool]:
    """One accepted effect with its gain beside the others, and whether it stands."""
    one = model.accepted[k]
    if one.variant is None and not one.reobserves:
        return one, True  # seen in the samples themselves; nothing in the model hangs on it
    without = with_only(model, tuple(other for j, other in enumerate(model.accepted) if j != k))
    held = held_out_records(without.fitted, without.prediction, model.fitted, model.prediction)
    if one.reobserves:
        assert one.evidence is not None
        gain = explained(without.fitted, model.fitted)
        held_up = getattr(one.effect, "is_proof", False) or mends(
            without.fitted, without.prediction, model.fitted, model.prediction, one.evidence.touched
        )
        return replace(one, gain=gain, held_out=one.evidence.held_out or held), held_up
    assert one.variant is not None
    first = sum(o.variant.distortion.n_parameters for o in model.accepted[:k] if o.variant is not None)
    against = Comparison(
        one.variant, one.effect.is_local, without.fitted, without.prediction, model.fitted,
        cost_of(model.fitted, one.rank, len(one.variant.shape)), first, model.prediction,
    )  # fmt: skip
    bic = against.bic_gain
    gain = explained(without.fitted, model.fitted)
    now = replace(one, delta_bic=bic, gain=gain, held_out=held)
    return now, stands(against, one.effect, without.context)


def stands(against: Comparison, effect: Effect, context: Context) -> bool:
    """Whether an effect keeps its place among others: sound, and its share of its own sensor's misfit removed."""
    return is_sound(against, effect, context) and explains(against)


def explains(against: Comparison) -> bool:
    """Whether the effect removes its share of the misfit in a domain of its own sensor where it removes much.

    Not of all domains together: another fault may spoil the others, and that is not this effect's to explain.
    """
    base = in_the_scatter_of(against.base, against.fitted)
    before, after = domain_chi2(base), domain_chi2(against.fitted)
    own = own_domains(against.variant.distortion)
    most = max(before[d][0] - after[d][0] for d in own)
    agrees = {DYNAMICS: AGREES * _other_sensor(against.variant.distortion, after)}
    helped = [d for d in own if before[d][0] - after[d][0] >= COMPARABLE * most]
    if against.variant.distortion.force is None and MOVES in helped:
        # Rates that err turn gravity first, and velocity by that: it cannot speak where gravity stays unexplained.
        helped = [d for d in helped if d != DYNAMICS]
    return any(_explained(before[d], after[d], agrees.get(d, AGREES)) for d in helped)


def _other_sensor(distortion: Distortion, after: dict[int, tuple[float, float]]) -> float:
    """χ² per degree of freedom, at least 1, of the other sensor's poses: velocity needs both sensors."""
    other = STATIC_GYRO if distortion.rate is None else STATIC_ACCEL
    if distortion.force is not None and distortion.rate is not None:
        return 1.0
    chi2, dof = after.get(other, (0.0, 1.0))
    return max(chi2 / max(dof, 1.0), 1.0)


def _explained(before: tuple[float, float], after: tuple[float, float], agrees: float) -> bool:
    """Whether a domain's excess of chi-square (chi-square, degrees of freedom) is gone by the share asked for."""
    (chi2, dof), (left, left_dof) = before, after
    if chi2 <= AGREES * dof or left <= agrees * left_dof:
        return True
    return 1.0 - (left - left_dof) / (chi2 - dof) > LEAST_SHARE
