"""Accepted effects as the record that reports and files show."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.selection.excess import excess
from trihedron.diagnose.selection.model import Accepted, StepwiseModel
from trihedron.diagnose.session.solve import Fit
from trihedron.records.diagnosis import AcceptedEffect, EffectParameter


def accepted_effects(model: StepwiseModel, numbers: Fit | None = None) -> tuple[AcceptedEffect, ...]:
    """Every accepted effect with its parameters, the one that explains most of the misfit first.

    ``numbers`` is the fit that parameters and their errors are taken from, where it is another than the model's.
    """
    final = model.fitted if numbers is None else numbers
    covariance = final.covariance()
    n = final.n_effect
    effect_cov = covariance[len(covariance) - n :, len(covariance) - n :]
    first = 0
    out = []
    for found, share in zip(model.accepted, shares(model), strict=True):
        k = 0 if found.variant is None else found.variant.distortion.n_parameters
        span = slice(first, first + k)
        first += k
        values, cov = final.twin.effect[span], effect_cov[span, span]
        if found.evidence is not None:
            again = found.evidence.restate
            parameters = found.evidence.parameters if again is None else again(Context(final.line.obs, final))
            statement = found.evidence.statement
        else:
            assert found.variant is not None
            parameters = found.effect.parameters(found.variant, values, cov)
            statement = found.effect.statement(parameters)
        is_behind = found.effect.is_spread or (_stated(found) is not None and share < HEADLINE)
        record = replace(_accepted(found, values, parameters, statement), share=share)
        is_beside = found.variant is None and not found.reobserves  # nothing in the fit hangs on it
        out.append(((is_behind, -share, is_beside), record))
    return tuple(one for _, one in sorted(out, key=lambda pair: pair[0]))


HEADLINE = 0.5
"""What carries less than half of the samples' own variance (a faint line) or poses (one bump) follows behind whatever
explains poses and moves."""


def shares(model: StepwiseModel) -> tuple[float, ...]:
    """Part of the misfit that each accepted effect explains: its gain over all gains and what is left unexplained.

    An effect that is not a matter of poses and moves (a line in the samples, one bumped pose) states its own share.
    """
    gains = [0.0 if _stated(one) is not None else max(one.gain, 0.0) for one in model.accepted]
    whole = max(sum(gains) + excess(model.fitted), 1e-9)
    return tuple(
        gain / whole if (own := _stated(one)) is None else own for one, gain in zip(model.accepted, gains, strict=True)
    )


def are_footnotes(model: StepwiseModel) -> bool:
    """Whether nothing accepted is an answer: single poses, a faint line, scatter that is little of what zeros do, what
    is seen in the samples and changes nothing in the fit."""
    return all(
        share < HEADLINE
        and (
            _stated(one) is not None
            or one.effect.is_spread
            or one.effect.is_local
            or (one.variant is None and not one.reobserves)
        )
        for one, share in zip(model.accepted, shares(model), strict=True)
    )


def _stated(one: Accepted) -> float | None:
    return None if one.evidence is None else one.evidence.share


def _accepted(
    found: Accepted, values: np.ndarray, parameters: tuple[EffectParameter, ...], statement: str
) -> AcceptedEffect:
    shape = {} if found.variant is None else {name: v for name, (v, _) in found.variant.shape.items()}
    by_id = {effect.id: effect for effect in catalogue()}
    either = (found.effect, by_id[found.rivals[0]]) if found.rivals else ()
    experiment = " / ".join(dict.fromkeys(e for one in either if (e := one.separating_experiment())))
    return AcceptedEffect(
        id=found.effect.id,
        statement=statement,
        parameters=parameters,
        p_adjusted=found.p_adjusted,
        delta_bic=found.delta_bic,
        held_out=found.held_out,
        confounded_with=found.rivals,
        separating_experiment=experiment,
        model=MappingProxyType(
            {
                "variant": "" if found.variant is None else found.variant.label,
                "shape": shape,
                "values": [float(v) for v in values],
                "applies_to_other_recordings": found.effect.applies_elsewhere,
                **({} if found.evidence is None or not found.evidence.series else {"curve": found.evidence.series}),
            }
        ),
    )
