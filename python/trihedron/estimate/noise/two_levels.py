"""A level that switches between two values in a static log (telegraph noise).

A spectrum does not tell it from flicker or a bounded walk; but means of short stretches have two values, those of
Gaussian noise have all.
"""

import math
from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.estimate.noise.slow_changes import block_means

EARNED = 20.0
"""Least excess of twice the log-likelihood over the best Gaussian process. By Markov's inequality a likelihood ratio of
e^10 for levels that are given comes by chance in e^-10 = 5e-5 of logs. With fitted levels, and any number of switches,
it is 3e-4 in Gauss-Markov noise and 1e-4 at the most in white noise, a walk and flicker (benches/static_screening.py);
those with ``FEWEST`` switches are fewer."""
FEWEST = 4
"""Fewest switches; fewer are steps."""


@dataclass(frozen=True)
class TwoLevels:
    """Levels ``size`` apart, ``n_switches`` in the log, each held for ``held_s`` on average; ``rise`` is twice the rise
    of the log-likelihood above the best Gaussian process."""

    size: float
    n_switches: int
    held_s: float
    rise: float


def two_levels(x: FloatArray, rate_hz: float) -> TwoLevels | None:
    """The two levels of readings ``x`` (n,), NaN where missing; ``None`` where Gaussian noise explains them as well."""
    means = block_means(x)
    if means is None:
        return None
    scale = float(means.y.std())
    y = (means.y - means.y.mean()) / scale
    low, high = np.quantile(y, (0.15, 0.85))
    likelihood, levels, is_high = _core.two_levels(y, (low, high))
    n_switches = int(np.count_nonzero(np.diff(is_high)))
    deviance = min(means.likely(np.empty((0, len(means.coefficients))), noise).deviance for noise in means.noises)
    rise = 2.0 * likelihood + deviance + len(means.coefficients) * math.log(2.0 * math.pi / scale**2)
    if n_switches < FEWEST or rise < EARNED:
        return None
    duration_s = len(x) / rate_hz
    return TwoLevels(scale * abs(levels[1] - levels[0]), n_switches, duration_s / (n_switches + 1), rise)
