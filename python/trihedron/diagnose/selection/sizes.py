"""A candidate with the size it comes out with: its columns made for that, its shape number at the profile's top."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.selection.compare import Refit, refit
from trihedron.diagnose.selection.model import StepwiseModel
from trihedron.diagnose.session.solve import reduce, score


def refined(model: StepwiseModel, best: Refit) -> Refit:
    """The shape number at the top of the profile likelihood, with the standard error its curvature gives.

    A parabola through log-spaced values around the grid's best; done again so that a far optimum is reached.
    """
    context: Context = model.context
    best = rescaled(model, best)
    variant = best.scored.variant
    if len(variant.shape) != 1:
        return best
    name, (value, unit) = next(iter(variant.shape.items()))
    effect = best.scored.effect
    if effect.reshaped(context, variant, value) is None:
        return best
    spread = WIDEST_LOG
    reduced = reduce(context.fitted)

    def gain(v: float) -> float:
        made = effect.reshaped(context, variant, v)
        assert made is not None
        return score(reduced, context.fitted.line.columns(made.distortion)).chi2

    sigma_log = float("inf")
    for _ in range(3):
        x = np.linspace(-spread, spread, 5)
        g = np.array([gain(value * float(np.exp(step))) for step in x])
        a, b, _c = np.polyfit(x, g, 2)
        if a < 0.0:
            move = float(np.clip(-b / (2 * a), -spread, spread))
            sigma_log = float(np.sqrt(-1.0 / a))
        else:
            move = float(x[g.argmax()])
        value *= float(np.exp(move))
        spread = float(np.clip(2.0 * sigma_log, NARROWEST_LOG, WIDEST_LOG))
    made = effect.reshaped(context, variant, value)
    assert made is not None
    final = replace(made, shape={name: (value, unit)}, shape_sigma=float(value * min(sigma_log, 10.0)))
    finer = refit(model, replace(best.scored, variant=final))
    return finer if finer.against.bic_gain >= best.against.bic_gain else best


def rescaled(model: StepwiseModel, best: Refit) -> Refit:
    """An effect whose columns are made for one size (a time), with those of the size that it comes out with."""
    for _ in range(N_RESCALED):
        again = best.scored.effect.rescaled(model.context, best.scored.variant, best.against.value)
        if again is None:
            break
        best = refit(model, replace(best.scored, variant=again))
    return best


N_RESCALED = 2
"""A size off by 20 % is off by 4 %, then by 0.2 %, of the second-order term."""
WIDEST_LOG, NARROWEST_LOG = 0.5, 0.05
"""Half-width, in the logarithm of the shape, over which a parabola is laid: one grid step, and the finest worth it."""
