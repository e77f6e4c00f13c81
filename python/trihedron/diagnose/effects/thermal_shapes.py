"""Bias against a logged temperature: linear, quadratic, with its rate, different while heating and cooling."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Variant, per_axis
from trihedron.diagnose.session.state import Distortion

LEAST_RATE_RANGE = 0.3
"""Range of the rate of temperature over its largest value, below which it is confounded with a constant."""
BRANCH_K_S = 0.002
"""Rate of change at which a branch reaches three quarters: an oven has ten times as much, a room a tenth."""


def thermal_sizes(context: Context, variant: Variant, per_kelvin: float) -> FloatArray:
    """(k,) expected size of the parameters, one sigma, where a bias changes by ``per_kelvin``.

    The quadratic, rate and hysteresis terms change the bias by a third of what the linear term does.
    """
    assert context.temperature is not None
    swing = float(np.ptp(context.temperature))
    beside = per_kelvin * swing / 3.0
    by_name = {"bias_per_kelvin": per_kelvin, "bias_per_kelvin2": beside / swing**2, "half_gap": beside}
    if context.temperature_rate is not None:
        by_name["bias_per_kelvin_per_s"] = beside / max(float(np.abs(context.temperature_rate).max()), BRANCH_K_S)
    return np.array([by_name[name.rsplit("_", 1)[0]] for name in variant.names])


def thermal_bias_variants(
    context: Context,
    on_axes: Callable[[FloatArray], FloatArray],
    only: Callable[[FloatArray], Distortion],
    unit: str,
) -> list[Variant]:
    """Forward models, simplest first. Temperature is relative to its mean over the poses, its rate to 0."""
    assert context.temperature is not None
    three = np.ones(3)
    t = context.temperature[:, None] * three
    linear, square = on_axes(t), on_axes(t**2)
    names, units = per_axis("bias_per_kelvin"), (f"{unit}/K",) * 3
    out = [
        Variant(only(linear), names, units, label="linear"),
        Variant(
            only(np.concatenate([linear, square], axis=2)), names + per_axis("bias_per_kelvin2"),
            units + (f"{unit}/K^2",) * 3, label="quadratic",
        ),
    ]  # fmt: skip
    speed = context.temperature_rate
    # Compensation of another log (no poses) needs the fitted shape, whatever that log's temperature does.
    is_fitted = context.obs.n_poses > 0
    if speed is None:
        return out
    if is_fitted and (not speed.any() or np.ptp(speed) < LEAST_RATE_RANGE * np.abs(speed).max()):
        return out
    by_rate = on_axes(speed[:, None] * three)
    out.append(
        Variant(
            only(np.concatenate([linear, by_rate], axis=2)), names + per_axis("bias_per_kelvin_per_s"),
            units + (f"{unit}/(K/s)",) * 3, label="rate",
        )
    )  # fmt: skip
    if not is_fitted or (speed.min() < -BRANCH_K_S and speed.max() > BRANCH_K_S):
        branch = on_axes(np.tanh(speed / BRANCH_K_S)[:, None] * three)
        out.append(
            Variant(
                only(np.concatenate([linear, branch], axis=2)), names + per_axis("half_gap"), units + (unit,) * 3,
                label="hysteresis",
            )
        )  # fmt: skip
    return out
