"""What the error over a horizon is made of (docs/filter-noise.md)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.integrate import trapezoid

from trihedron.arrays import FloatArray
from trihedron.estimate.filter_noise.strengths import ABSENT
from trihedron.estimate.filter_noise.stretch import NAMES, matern
from trihedron.records.filter_noise import CAUSES, Bounded, Cause, Share


def parts_of(draws: FloatArray, horizon_s: float, tilt_m_s2: float | None = None) -> dict[Cause, FloatArray]:
    """Mean squares (k,) of all three axes together by cause, under strengths (k, 7), without the correction's.

    Of an angle over h: 3 N² h, 3 V² h, K² h³, and of a reference the difference of two of its errors,
    2 σ² (1 - k(h)) and white. ``tilt_m_s2`` makes it a velocity: a slow tilt adds g² over h, of two axes.
    """
    s = dict(zip(NAMES, draws.T, strict=True))
    h = horizon_s
    out: dict[Cause, FloatArray] = {"rest": 3.0 * s["noise"] ** 2 * h, "vibration": 3.0 * s["vibration"] ** 2 * h}
    out["bias"] = s["bias_walk"] ** 2 * h**3
    if tilt_m_s2 is None:
        slow = 6.0 * (s["world"] ** 2 + s["body"] ** 2) * (1.0 - matern(h, s["slow_s"]))
        out["reference"] = 6.0 * s["white"] ** 2 + slow
    else:
        out["reference"] = 12.0 * s["white"] ** 2 + 2.0 * (tilt_m_s2 * s["world"]) ** 2 * _twice_summed(h, s["slow_s"])
    return out


def shares_over(parts: dict[Cause, FloatArray], horizon_s: float) -> tuple[Share, ...]:
    """Shares with 95 % intervals of causes' mean squares (k,); a cause without a part has no share."""
    total = np.sum(list(parts.values()), axis=0)
    return tuple(Share(name, horizon_s, bounded(parts[name] / total)) for name in CAUSES if name in parts)


def bounded(values: Sequence[float] | FloatArray) -> Bounded:
    """Median and 95 % interval of draws; only a limit where the interval reaches over a factor of ``ABSENT``."""
    low, middle, high = (float(v) for v in np.quantile(values, [0.025, 0.5, 0.975]))
    is_limit = high > 0.0 and low < high / ABSENT
    return Bounded(middle, 0.0 if is_limit else low, high, is_limit)


def _twice_summed(h: float, tau_s: FloatArray) -> FloatArray:
    """Variance of the integral over h of a Matérn-3/2 process of variance one."""
    lag = np.linspace(0.0, h, 101)
    kernel = matern(lag[None, :], tau_s[:, None])
    return np.asarray(2.0 * trapezoid((h - lag) * kernel, lag, axis=1))
