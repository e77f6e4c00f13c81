"""Shape numbers of accepted effects (time constants, widths) fitted along with everything else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.selection.model import Accepted, StepwiseModel
from trihedron.diagnose.session.solve import Fit, tune_noise
from trihedron.diagnose.session.twin import Distortion, stacked

N_STEPS = 3
"""Gauss-Newton steps at most: the shape comes from the top of its profile, and only what joined later has moved it."""
STEP_LOG, LONGEST_LOG = 0.02, 0.5
"""Half-step of the derivative by the logarithm of a shape, and the longest step that it is believed for."""
SETTLED = 0.1
"""Step in its own standard errors below which a shape is where it belongs."""
UNKNOWN_LOG = 1.0
"""Standard error, in the logarithm, of a shape that the session does not tell: no straight line spans a factor of e."""


def with_shapes(model: StepwiseModel, fitted: Fit) -> tuple[StepwiseModel, Fit]:
    """The effects at shapes fitted with all other numbers, and that fit, in whose covariance the shapes are unknowns.

    Per shape one more column, p D'(ln shape), behind the effects' own: with the shape held fixed S, b and p would claim
    to be known better than they are (eq. 8.12a). A shape that the session does not tell stays as it was chosen.
    """
    untold: frozenset[int] = frozenset()
    for _ in range(N_STEPS):
        wider, columns, untold = _widened(model, fitted, untold)
        if not columns:
            return model, fitted
        n = fitted.n_effect
        step = wider.twin.effect[n:]
        sigma = _errors(wider, len(columns))
        is_settled = bool((np.abs(step) < SETTLED * sigma).all())
        accepted = list(model.accepted)
        for k, by, error in zip(columns, step, sigma, strict=True):
            accepted[k] = _moved(model, accepted[k], 0.0 if is_settled else float(by), float(error))
        model = replace(model, accepted=tuple(accepted))
        if is_settled:
            break
        start = replace(wider.twin, effect=wider.twin.effect[:n])
        fitted = tune_noise(fitted.line.obs, start, stacked(model.distortions), model.prior)
    else:
        wider, _, _ = _widened(model, fitted, untold)
    return model, wider


def _widened(
    model: StepwiseModel, fitted: Fit, untold: frozenset[int]
) -> tuple[Fit, dict[int, Distortion], frozenset[int]]:
    """The fit with a column per shape that the session tells, those columns by effect, and the effects whose is not."""
    while True:
        told = (k for k in range(len(model.accepted)) if k not in untold)
        columns = {k: c for k in told if (c := _by_shape(model, fitted, k)) is not None}
        if not columns:
            return fitted, columns, untold
        start = replace(fitted.twin, effect=np.concatenate([fitted.twin.effect, np.zeros(len(columns))]))
        wider = tune_noise(
            fitted.line.obs, start, stacked([*model.distortions, *columns.values()]), model.prior
        )  # fmt: skip
        sigma = _errors(wider, len(columns))
        lost = {k for k, error in zip(columns, sigma, strict=True) if not error < UNKNOWN_LOG}
        if not lost:
            return wider, columns, untold
        untold |= lost


def _errors(fitted: Fit, n: int) -> FloatArray:
    """(n,) standard errors of the last parameters of a fit."""
    errors: FloatArray = np.sqrt(np.maximum(np.diag(fitted.covariance())[-n:], 0.0))
    return errors


def _by_shape(model: StepwiseModel, fitted: Fit, k: int) -> Distortion | None:
    """What an effect adds per unit of the logarithm of its shape; ``None`` where it has none that is continuous."""
    one = model.accepted[k]
    if one.variant is None or one.variant.shape_sigma <= 0.0 or len(one.variant.shape) != 1:
        return None
    sides = [_reshaped(model, one, one.variant, by) for by in (-STEP_LOG, STEP_LOG)]
    if sides[0] is None or sides[1] is None:
        return None
    before, after = sides[0].distortion, sides[1].distortion
    first = sum(o.variant.distortion.n_parameters for o in model.accepted[:k] if o.variant is not None)
    value = fitted.twin.effect[first : first + one.variant.distortion.n_parameters]

    def slope(name: str) -> FloatArray | None:
        low, high = getattr(before, name), getattr(after, name)
        return None if low is None else ((high - low) @ value / (2.0 * STEP_LOG))[:, :, None]

    return Distortion(slope("force"), slope("rate"))


def _reshaped(model: StepwiseModel, one: Accepted, variant: Variant, by: float) -> Variant | None:
    ((_, (value, _)),) = variant.shape.items()
    return one.effect.reshaped(model.context, variant, value * float(np.exp(by)))


def _moved(model: StepwiseModel, one: Accepted, by: float, sigma_log: float) -> Accepted:
    """The effect with its shape moved by a step of its logarithm, and its standard error."""
    assert one.variant is not None
    ((name, (value, unit)),) = one.variant.shape.items()
    if by == 0.0:
        return replace(one, variant=replace(one.variant, shape_sigma=value * sigma_log))
    by = float(np.clip(by, -LONGEST_LOG, LONGEST_LOG))
    value *= float(np.exp(by))
    again = _reshaped(model, one, one.variant, by)
    assert again is not None
    return replace(one, variant=replace(again, shape={name: (value, unit)}, shape_sigma=value * sigma_log))
