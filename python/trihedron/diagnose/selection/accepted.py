"""Accepted effects as the record that reports and files show."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.selection.model import Found, GrowingModel
from trihedron.records.diagnosis import AcceptedEffect, EffectParameter


def worded(model: GrowingModel) -> tuple[AcceptedEffect, ...]:
    covariance = model.fitted.covariance()
    n = model.fitted.n_effect
    effect_cov = covariance[len(covariance) - n :, len(covariance) - n :]
    first = 0
    spans: dict[int, slice] = {}
    for k, found in enumerate(model.found):
        if found.variant is not None:
            k_parameters = found.variant.distortion.n_parameters
            spans[k] = slice(first, first + k_parameters)
            first += k_parameters
    out = []
    for k, found in enumerate(model.found):
        values = model.fitted.twin.effect[spans[k]] if k in spans else np.zeros(0)
        cov = effect_cov[spans[k], spans[k]] if k in spans else np.zeros((0, 0))
        if found.evidence is not None:
            parameters = found.evidence.parameters
            statement = found.evidence.statement
        else:
            assert found.variant is not None
            parameters = found.effect.parameters(found.variant, values, cov)
            statement = found.effect.statement(parameters)
        out.append((found, values, parameters, statement))
    # What the recording gains most by comes first; a range that ends is no matter of degree.
    out.sort(key=lambda item: ("saturation" not in item[0].effect.id, -item[0].delta_bic))
    return tuple(_accepted(*item) for item in out)


def _accepted(
    found: Found, values: np.ndarray, parameters: tuple[EffectParameter, ...], statement: str
) -> AcceptedEffect:
    shape = {} if found.variant is None else {name: v for name, (v, _) in found.variant.shape.items()}
    by_id = {effect.id: effect for effect in catalogue()}
    experiment = by_id[found.rivals[0]].experiment if found.rivals else ""
    experiment = " / ".join(
        dict.fromkeys(e for e in (found.effect.experiment if found.rivals else "", experiment) if e)
    )
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
            }
        ),
    )
