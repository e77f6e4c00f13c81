"""What is taken out again once everything is accepted: effects that leave their domains as they were."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from trihedron.diagnose.residuals.goodness_of_fit import ROW_DOMAINS
from trihedron.diagnose.selection.model import Found, GrowingModel
from trihedron.diagnose.session.solve import N_DOMAINS, folds_of, predict_held_out, tune_noise
from trihedron.diagnose.session.twin import Prior, stacked
from trihedron.records.diagnosis import Domain, DomainTest

KEPT_EXCESS = 0.5
"""An effect whose domain keeps more than half of its misfit after everything is accepted explains nothing."""
KEPT_NATURAL = 0.3
"""Nor does an effect of one sensor if the domains of that sensor together keep this share."""


def drop_hollow(
    model: GrowingModel, domains: tuple[DomainTest, ...], remaining: tuple[DomainTest, ...], prior: Prior | None
) -> bool:
    """Take out effects whose domain still carries most of its misfit: a least bad guess is not an answer."""
    before = {d.domain: d for d in domains}
    after = {d.domain: d for d in remaining}
    hollow = []
    for found in model.found:
        if found.evidence is not None or found.primary < 0:
            continue
        name: Domain = ROW_DOMAINS[found.primary]
        if name not in before or name not in after or not after[name].disagrees:
            continue
        excess_before = before[name].chi2_per_dof - 1.0
        excess_after = after[name].chi2_per_dof - 1.0
        if excess_before > 0 and excess_after > KEPT_EXCESS * excess_before:
            hollow.append(found)
    hollow += [f for f in model.found if f not in hollow and _keeps_misfit(f, before, after)]
    if not hollow:
        return False
    model.found = [f for f in model.found if f not in hollow]
    model.distortions = [f.variant.distortion for f in model.found if f.variant is not None]
    start = replace(model.fitted.twin, effect=np.zeros(sum(d.n_parameters for d in model.distortions)))
    model.fitted = tune_noise(model.obs, start, stacked(model.distortions), prior)
    model.prediction = predict_held_out(model.fitted, folds_of(model.fitted), N_DOMAINS)
    return True


def _keeps_misfit(found: Found, before: Mapping[Domain, DomainTest], after: Mapping[Domain, DomainTest]) -> bool:
    """Whether the domains where an effect of one sensor must show keep much of their misfit after everything."""
    if found.evidence is not None or found.variant is None:
        return False
    distortion = found.variant.distortion
    if (distortion.force is None) == (distortion.rate is None):
        return False
    natural: tuple[Domain, ...] = ("static-gyro", "moves") if distortion.force is None else ("static-accel", "dynamics")
    pairs = [(before[name], after[name]) for name in natural if name in before and name in after]
    if not any(b.disagrees and a.disagrees for b, a in pairs):
        return False
    excess = [sum(max(t[k].chi2_per_dof - 1.0, 0.0) * t[k].dof for t in pairs) for k in (0, 1)]
    return bool(excess[1] > KEPT_NATURAL * excess[0])


def settle_direct(model: GrowingModel, remaining: tuple[DomainTest, ...]) -> tuple[DomainTest, ...]:
    """Sample-level domains whose disagreement an accepted direct effect accounts for agree afterwards."""
    explained = {f.evidence.domain for f in model.found if f.evidence is not None}
    if any(f.effect.id == "vibration-rectification" for f in model.found):
        explained.add("within-static")  # the shaking that the effect follows is the disagreement seen there
    return tuple(
        replace(d, disagrees=False) if d.domain in explained and d.domain in ("within-static", "timing") else d
        for d in remaining
    )
