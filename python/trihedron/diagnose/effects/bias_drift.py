"""A bias that drifts in time and that no logged channel explains: the part common to both sensors."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.bias_process import BiasProcess, per_axis_parameters
from trihedron.diagnose.effects.contract import Variant, per_axis
from trihedron.diagnose.session.state import Distortion
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.words import Words


class BiasDrift(BiasProcess):
    """Warm-up exponential, straight line or slow curve per axis, or a walk stronger than the part's noise explains."""

    walks = True
    typical: ClassVar[float]
    """Bias change of typical parts while they warm up, one sigma, SI."""

    @abstractmethod
    def on_axes(self, context: Context) -> Callable[[FloatArray], FloatArray]:
        """Columns per sensor axis from values (n, 3) along the sensor axes."""

    @abstractmethod
    def only(self, columns: FloatArray) -> Distortion:
        """The distortion with these columns for this sensor alone."""

    def variants(self, context: Context) -> list[Variant]:
        return drift_variants(context, self.on_axes(context), self.only, self.unit, self.n_waves(context.obs.n_poses))

    def sizes(self, context: Context, variant: Variant) -> FloatArray:  # noqa: ARG002
        return np.full(variant.distortion.n_parameters, self.typical)

    def n_waves(self, n_poses: int) -> int:  # noqa: ARG002
        """Number of cosines per axis that this many poses can determine."""
        return 4

    def reshaped(self, context: Context, variant: Variant, value: float) -> Variant | None:
        if variant.label != "warm-up":
            return None
        return warm_up_variant(context, self.on_axes(context), self.only, self.unit, value)

    def is_plausible_variant(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:  # noqa: ARG002
        return is_possible_drift(variant, value)

    def of_strength(self, size: FloatArray, std: FloatArray) -> tuple[tuple[EffectParameter, ...], Words]:
        return per_axis_parameters("range", size, std, self.unit), self.told("walk", range=size)


# Smooth curves in time that a bias drift may follow.

MOST_M_S2, MOST_RAD_S = 0.6, 0.09
"""Largest bias change of a part while it warms up (0.06 g, 5 °/s; chambers of 90 K show as much); a larger one
indicates a disturbed pose."""
STILL_THERE, FEWEST_POSES_OF_A_DRIFT = 0.1, 3
"""Share of a drift that must remain at the third pose: a faster decay concerns one or two poses, not the session."""
WARM_UP_FRACTIONS = (0.04, 0.1, 0.25, 0.6)
"""Time constants tried, as fractions of the recording: faster ones end before the first moves, slower are a line."""


def drift_variants(
    context: Context,
    on_axes: Callable[[FloatArray], FloatArray],
    only: Callable[[FloatArray], Distortion],
    unit: str,
    n_waves: int = 4,
) -> list[Variant]:
    """Line, warm-up exponentials, and a slow curve of ``n_waves`` cosines per axis."""
    x = context.elapsed
    three = np.ones(3)
    out = [Variant(only(on_axes((x - 0.5)[:, None] * three)), per_axis("drift"), (unit,) * 3, label="line")]
    duration = float(context.obs.time_s[-1] - context.obs.time_s[0])
    shortest = shortest_time_constant(context)
    taus = [fraction * duration for fraction in WARM_UP_FRACTIONS]
    out += [warm_up_variant(context, on_axes, only, unit, tau) for tau in taus if tau >= shortest]
    if not n_waves:
        return out
    orders = tuple(range(1, n_waves + 1))
    axes = on_axes(np.ones((1, 3)))[0]
    # Every cosine along every axis, as one matrix product.
    spread = np.zeros((len(orders), 3, 3 * len(orders)))
    for k in range(len(orders)):
        spread[k, :, 3 * k : 3 * k + 3] = axes
    waves = np.cos(np.pi * np.outer(x, orders)) @ spread.reshape(len(orders), -1)
    waves = waves.reshape(-1, 3, 3 * len(orders))
    names = tuple(name for k in orders for name in per_axis(f"cosine{k}"))
    out.append(Variant(only(waves), names, (unit,) * len(names), label="curve"))
    return out


def warm_up_variant(
    context: Context,
    on_axes: Callable[[FloatArray], FloatArray],
    only: Callable[[FloatArray], Distortion],
    unit: str,
    tau_s: float,
) -> Variant:
    """An exponential with one time constant; its parameters are the bias per axis at the first sample."""
    tau_s = max(tau_s, shortest_time_constant(context))
    elapsed_s = context.time_s - context.obs.time_s[0]
    columns = on_axes(np.exp(-elapsed_s / tau_s)[:, None] * np.ones(3))
    return Variant(only(columns), per_axis("warm_up"), (unit,) * 3, {"time_constant": (tau_s, "s")}, "warm-up")


def shortest_time_constant(context: Context) -> float:
    """Shortest time constant, s: a faster exponential is over before the third pose."""
    middles = context.obs.pose_time_s
    if len(middles) < FEWEST_POSES_OF_A_DRIFT:
        return 0.0
    return float(middles[FEWEST_POSES_OF_A_DRIFT - 1] - middles[0]) / float(-np.log(STILL_THERE))


def is_possible_drift(variant: Variant, value: FloatArray) -> bool:
    """Whether the peak-to-peak range of the curve is at most that of a part's bias (``MOST_M_S2``, ``MOST_RAD_S``)."""
    for side, most in ((variant.distortion.force, MOST_M_S2), (variant.distortion.rate, MOST_RAD_S)):
        if side is None:
            continue
        # Contiguous per axis: ptp over rows of three takes ten times as long.
        drift = np.ascontiguousarray((side.reshape(-1, len(value)) @ value).reshape(len(side), 3).T)
        if float(np.ptp(drift, axis=1).max(initial=0.0)) > most:
            return False
    return True
