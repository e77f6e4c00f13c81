"""Smooth curves in time that a hidden drift may follow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Variant, per_axis
from trihedron.diagnose.session.observations import FloatArray
from trihedron.diagnose.session.twin import Distortion

WARM_UP_FRACTIONS = (0.04, 0.1, 0.25, 0.6)
"""Time constants tried, as fractions of the recording: faster is over before the first moves, slower is a line."""


def drift_variants(
    context: Context,
    on_axes: Callable[[FloatArray], FloatArray],
    only: Callable[[FloatArray], Distortion],
    unit: str,
) -> list[Variant]:
    """Line, warm-up exponentials, and a slow curve of four cosines per axis."""
    x = context.elapsed
    three = np.ones(3)
    out = [Variant(only(on_axes((x - 0.5)[:, None] * three)), per_axis("drift"), (unit,) * 3, label="line")]
    duration = float(context.obs.time_s[-1] - context.obs.time_s[0])
    out += [warm_up_variant(context, on_axes, only, unit, fraction * duration) for fraction in WARM_UP_FRACTIONS]
    waves = np.concatenate([on_axes(np.cos(np.pi * k * x)[:, None] * three) for k in (1, 2, 3, 4)], axis=2)
    names = tuple(name for k in (1, 2, 3, 4) for name in per_axis(f"cosine{k}"))
    out.append(Variant(only(waves), names, (unit,) * 12, label="curve"))
    return out


def warm_up_variant(
    context: Context,
    on_axes: Callable[[FloatArray], FloatArray],
    only: Callable[[FloatArray], Distortion],
    unit: str,
    tau_s: float,
) -> Variant:
    """An exponential of one time constant; its parameter is the bias at the first sample."""
    elapsed_s = context.time_s - context.obs.time_s[0]
    columns = on_axes(np.exp(-elapsed_s / tau_s)[:, None] * np.ones(3))
    return Variant(only(columns), per_axis("warm_up"), (unit,) * 3, {"time_constant": (tau_s, "s")}, "warm-up")
