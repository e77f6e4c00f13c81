"""Shape parameters of an effect (a time constant, a delay): fitted, then carried as unknowns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.candidates import Tried
from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.hypothesis import Hypothesis, Term, again
from trihedron.diagnose.session.state import Distortion

SHAPE_STEPS = np.array([-0.6, -0.3, 0.0, 0.3, 0.6])
"""Steps of the logarithm of a shape parameter about the grid's best, to which a parabola is fitted."""
N_RESHAPED = 2
"""Iterations of size and shape: the second changes them by a tenth of what the first does."""
STEP_LOG = 0.02
"""Half-step of the numerical derivative by the logarithm of a shape parameter."""


def as_fits_best(model: Hypothesis, tried: Tried) -> Term:
    """A candidate with its columns computed for its fitted size, at its shape of maximum evidence."""
    term, asked = tried.term, tried.asked
    for _ in range(N_RESHAPED):
        made = term.effect.rescaled(model.context, term.variant, asked.value)
        if made is None:
            break
        term = replace(term, variant=made)
        asked = model.with_added([term])[0]
    return _reshaped(model, term)


def _reshaped(model: Hypothesis, term: Term) -> Term:
    """A term at the shape parameter of maximum evidence, with the standard uncertainty from the curvature."""
    if len(term.variant.shape) != 1:
        return term
    ((name, (value, unit)),) = term.variant.shape.items()
    if term.effect.reshaped(model.context, term.variant, value) is None:
        return term
    spread, sigma = 1.0, np.inf
    for _ in range(N_RESHAPED):
        steps = spread * SHAPE_STEPS
        made = [term.effect.reshaped(model.context, term.variant, value * float(np.exp(step))) for step in steps]
        asked = model.with_added([replace(term, variant=v) for v in made if v is not None])
        gain = np.array([one.log_evidence for one in asked])
        a, b, _ = np.polyfit(steps, gain, 2)
        if a < 0.0:
            value *= float(np.exp(np.clip(-b / (2.0 * a), steps[0], steps[-1])))
            sigma = float(np.sqrt(-0.5 / a))
            spread = float(np.clip(2.0 * sigma, 0.1, 1.0))
        else:
            value *= float(np.exp(steps[gain.argmax()]))
    final = term.effect.reshaped(model.context, term.variant, value)
    if final is None:
        return term
    return replace(term, variant=replace(final, shape={name: (value, unit)}, shape_sigma=value * min(sigma, 10.0)))


def with_shapes(model: Hypothesis) -> Hypothesis:
    """The hypothesis with its shape parameters as unknowns: one more column each, p D'(ln shape).

    With fixed shapes the uncertainties of S, b and p would be too small.
    """
    more = [term for k in range(len(model.terms)) if (term := _by_shape(model, k)) is not None]
    return again(model, [*model.terms, *more]) if more else model


def _by_shape(model: Hypothesis, k: int) -> Term | None:
    term = model.terms[k]
    if term.variant.shape_sigma <= 0.0 or len(term.variant.shape) != 1:
        return None
    ((_, (value, _)),) = term.variant.shape.items()
    made = [term.effect.reshaped(model.context, term.variant, value * float(np.exp(s))) for s in (-STEP_LOG, STEP_LOG)]
    if made[0] is None or made[1] is None:
        return None
    size, _ = model.value(k)
    low, high = made[0].distortion, made[1].distortion

    def slope(name: str) -> FloatArray | None:
        a, b = getattr(low, name), getattr(high, name)
        return None if a is None else ((b - a) @ size / (2.0 * STEP_LOG))[:, :, None]

    columns = Distortion(slope("force"), slope("rate"))
    return Term(term.effect, Variant(columns, ("shape",), ("1",), label="shape"), np.ones(1))
