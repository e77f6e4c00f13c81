"""Forward selection: every effect of the catalogue competes, the best one joins, and again (eq. 8.8-8.10)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.contract import Effect, Variant
from trihedron.diagnose.residuals.goodness_of_fit import strayed
from trihedron.diagnose.selection.compare import Comparison, Refit, refit
from trihedron.diagnose.selection.model import Accepted, Alternative, StepwiseModel
from trihedron.diagnose.selection.score import Scored, score_all
from trihedron.diagnose.selection.sizes import refined, rescaled
from trihedron.diagnose.session.solve import CORNER_GRID_S, fit
from trihedron.diagnose.session.twin import stacked
from trihedron.records.diagnosis import Candidate

MAX_EFFECTS = 4
"""Mechanisms accepted at most: a recording of one session does not carry evidence for more. Pushed poses are none."""
MAX_STEPS = 8
MIN_DELTA_BIC = 10.0
"""Kass and Raftery's bound for very strong evidence."""
OWN_TEST = 1e-4
"""Largest p-value of an effect's own test that stands for evidence: forty effects of the catalogue share 0.4 %."""
CONFOUNDED_DELTA_BIC = 6.0
"""Below a difference of 6 (strong evidence) two explanations are named together."""
LEFT_OVER = 0.5
"""Share of its merit from which a rival explains something of its own."""
N_REFITS = 4
"""Candidates fitted jointly at each step: the leaders of the score test."""
FAR_AHEAD = 4.0
"""A sound candidate whose score is this many times another's is not caught up by a joint fit, if that leaves little."""
LITTLE_LEFT = 1.5
"""Dispersion of every domain beside such a candidate. Where more stays, another may explain what its score, a straight
line at no effect, does not promise: a gyro's low-pass turns gravity by degrees, a late accelerometer by none."""


def scores(model: StepwiseModel, exclude: Collection[str] = ()) -> tuple[list[Scored], list[tuple[str, str]]]:
    """Score tests of the effects that the model does not hold yet, best first, and what does not apply."""
    taken = {one.effect.id for one in model.accepted if not one.effect.repeatable} | set(exclude)
    scored, missing = score_all(model.context, taken)
    plain = _without_walk(model)
    if plain is not None:
        # A walk at the end of its range takes up whatever is there, and so does scatter that is larger than what was
        # named beside drift, temperature and gravity: no score test sees through them. Which of the two it is their
        # joint fits decide, with either as strong as it likes on both sides.
        seen, _ = score_all(plain, taken)
        best = {(one.effect.id, one.variant.label, tuple(one.variant.shape.values())): one for one in scored}
        for one in seen:
            key = one.effect.id, one.variant.label, tuple(one.variant.shape.values())
            if key not in best or one.merit > best[key].merit:
                best[key] = one
        scored = sorted(best.values(), key=lambda one: -one.merit)
    return scored, missing


def _without_walk(model: StepwiseModel) -> Context | None:
    """The session with a walk no stronger than the quietest of parts, where the fit ran it to the end of its range, and
    with scatter no larger than the one that was named."""
    accel, gyro = strayed(model.fitted)
    twin = model.fitted.twin
    scatter = min(twin.scatter[0], 1.0), min(twin.scatter[1], 1.0)
    if not (accel or gyro or scatter != twin.scatter):
        return None
    quiet = replace(
        twin,
        accel_corner_s=CORNER_GRID_S[-1] if accel else twin.accel_corner_s,
        gyro_corner_s=CORNER_GRID_S[-1] if gyro else twin.gyro_corner_s,
        scatter=scatter,
    )
    return Context(model.obs, fit(model.obs, quiet, stacked(model.distortions), model.prior))


def candidates_of(
    scored: list[Scored], missing: list[tuple[str, str]], known: dict[str, Candidate]
) -> dict[str, Candidate]:
    """What every effect's test on the baseline said, with what was known from effects' own evidence."""
    out = dict(known) | {effect_id: Candidate(effect_id, None, False, reason) for effect_id, reason in missing}
    for s in scored:
        before = known.get(s.effect.id)
        p = s.p_value if before is None or before.p_value is None else min(s.p_value, before.p_value)
        out[s.effect.id] = Candidate(s.effect.id, p, True)
    return out


def with_next(model: StepwiseModel, scored: list[Scored], alpha: float) -> StepwiseModel | None:
    """The model with the effect that explains most of what is left; ``None`` where none is demanded."""
    n_effects = len(catalogue())
    first = list(dict.fromkeys(s.effect.id for s in scored))[:N_REFITS]
    leaders = [s for s in scored if s.effect.id in first and s.p_value * n_effects < alpha / 2.0]
    context = model.context
    refits: list[Refit] = []
    sound: list[Refit] = []
    for s in leaders:
        if any(r.scored.merit > FAR_AHEAD * s.merit and r.against.stays.max() < LITTLE_LEFT for r in sound):
            break
        refits.append(refit(model, s))
        if is_sound(refits[-1].against, s.effect, context) and s.effect.withstands(context):
            # Columns made for 32 ms are no match for a filter that may be of any length: each by its own size.
            refits[-1] = rescaled(model, refits[-1])
            sound.append(refits[-1])
    if not sound:
        return None
    # Rivals are compared against one rest, that of the best explained: else its small differences weigh large gains.
    rest = np.min([r.against.stays for r in sound], axis=0)
    best = max(sound, key=lambda r: r.against.bic_gain_at(rest))
    best = _logged_first(_likeliest(best, sound, rest), sound, rest)
    # What another mechanism explains as well: by its joint fit, or, for all of its shapes, by the score test.
    enough = best.against.bic_gain_at(rest) - CONFOUNDED_DELTA_BIC
    others = [r for r in refits if r.scored.effect is not best.scored.effect]
    close = [
        r.scored.effect.id
        for r in others
        if r.against.bic_gain_at(rest) > enough
        or (r in sound and r.against.equals(best.against, rest, CONFOUNDED_DELTA_BIC))
    ]
    close += [
        s.effect.id
        for s in scored
        if s.effect is not best.scored.effect and max(s.merits) > best.scored.merit - CONFOUNDED_DELTA_BIC
    ]
    alternatives = tuple(
        Alternative(r.scored.effect, r.against.variant, r.scored.rank)
        for r in sorted(others, key=lambda r: -r.against.bic_gain_at(rest))
        if r.against.bic_gain > MIN_DELTA_BIC
    )
    best = refined(model, best)
    one = Accepted(
        best.scored.effect, best.scored.variant, None, _p_adjusted(best, n_effects), best.against.bic_gain,
        best.against.gain_at(best.against.stays), best.against.held_out(), tuple(dict.fromkeys(close)),
        best.scored.rank, alternatives,
    )  # fmt: skip
    return replace(
        model,
        context=Context(model.obs, best.against.fitted),
        prediction=best.against.prediction,
        accepted=(*model.accepted, one),
    )


def _likeliest(best: Refit, sound: list[Refit], rest: FloatArray) -> Refit:
    """The candidate that no other is ahead of.

    A late clock and the other sensor's filter make one misfit: what a fall of the poses' lengths is worth does not say
    which of the two it is.
    """
    for r in sound:
        needed = head_start(r.scored.variant, best.scored.variant)
        if r.against.ahead_of(best.against, rest) > needed and r.against.equals(best.against, rest, -needed):
            best = r
    return best


def head_start(one: Variant, other: Variant) -> float:
    """ΔBIC by which one must be ahead of another to go before it: a shape that stands for many, of a plain one."""
    return CONFOUNDED_DELTA_BIC * (one.stands_for_many - other.stands_for_many)


def set_apart(model: StepwiseModel, before: list[Scored], after: list[Scored]) -> StepwiseModel:
    """The model whose last effect keeps those rivals only that have little left to explain beside it.

    What gains as much beside it as it did without it explains something else, and does not stand in its place either.
    """
    one = model.accepted[-1]
    was, still = ({s.effect.id: max(s.merits, default=s.merit) for s in scored} for scored in (before, after))

    def is_rival(effect_id: str) -> bool:
        return still.get(effect_id, -np.inf) < LEFT_OVER * was.get(effect_id, np.inf)

    kept = replace(
        one,
        rivals=tuple(i for i in one.rivals if is_rival(i)),
        alternatives=tuple(a for a in one.alternatives if is_rival(a.effect.id)),
    )
    return replace(model, accepted=(*model.accepted[:-1], kept))


def _logged_first(best: Refit, sound: list[Refit], rest: FloatArray) -> Refit:
    """A drift in time gives way to a logged temperature that explains as much: then something logged explains it."""
    enough = best.against.bic_gain_at(rest) - CONFOUNDED_DELTA_BIC
    thermal = [
        r for r in sound
        if gives_way(best.scored.effect.id, r.scored.effect.id) and r.against.bic_gain_at(rest) > enough
    ]  # fmt: skip
    return max(thermal, key=lambda r: r.against.bic_gain_at(rest), default=best)


def gives_way(one: str, other: str) -> bool:
    """Whether an effect is a drift in time and the other a logged temperature's work on the same sensor."""
    sensor, _, kind = one.partition("-")
    return kind == "hidden-drift" and other.startswith(f"{sensor}-thermal")


def is_demanded(against: Comparison, effect: Effect, context: Context) -> bool:
    """Whether the data ask for an effect: by ΔBIC, or, where a walk at the end of its range stands for whatever is
    there, or scatter does, by the effect's own test beside scatter, walk and drift (eq. Z.7), paid for by the search.

    Schwarz's log n counts the walk's rows as data; that test counts poses.
    """
    return against.bic_gain > MIN_DELTA_BIC or _stands_out(effect, context)


def _stands_out(effect: Effect, context: Context) -> bool:
    """Whether an effect's own test finds it where walk or scatter stand for whatever is there."""
    if context.obs.zero_scatter is None and not any(strayed(context.fitted)):
        return False
    p = effect.own_p_value(context)
    return p is not None and p < OWN_TEST


def is_sound(against: Comparison, effect: Effect, context: Context) -> bool:
    """The rules of acceptance: evidence, prediction, a fall in physical units, a size, a possible one."""
    return (
        is_demanded(against, effect, context)
        and is_predicted(against, effect, context)
        and against.has_size
        and effect.is_plausible_variant(against.variant, against.value, against.covariance)
    )


def is_predicted(against: Comparison, effect: Effect, context: Context) -> bool:
    """Whether what was held out is predicted better, and visibly so.

    A walk at the end of its range predicts any slow curve from its neighbours: where that is so, a test beside a walk
    of any strength stands for it.
    """
    if against.predicts and against.falls:
        return True
    return any(strayed(context.fitted)) and _stands_out(effect, context)


def _p_adjusted(best: Refit, n_effects: int) -> float:
    gain = best.against.bic_gain + best.against.cost
    p = min(best.scored.p_value, float(chdtrc(best.scored.rank, max(gain, 0.0)))) if gain > 0 else best.scored.p_value
    return float(min(1.0, max(p, 1e-300) * n_effects))
