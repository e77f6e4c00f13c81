"""White noise of X, Y and Z separately, in motion: rotation distributes them differently over the world axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize

from trihedron.arrays import FloatArray
from trihedron.estimate.filter_noise.strengths import ABSENT, PREFERRED, Fitted
from trihedron.estimate.filter_noise.stretch import NAMES, Stretch
from trihedron.probability import NORMAL_95
from trihedron.records.filter_noise import Bounded

STEP = 0.05
"""Step in the logarithm of an axis' density, for the curvature."""
AXES_SIGMA = float(np.log(3.0))
"""Prior σ of that logarithm about the axes' mean: axes of one chip differ by less than a factor of three."""


def unlike_axes_beside(stretches: Sequence[Stretch], found: Fitted, N: Bounded) -> tuple[Bounded, ...]:
    """N of each axis, static noise and vibration together, where the evidence prefers three densities to one; else ().

    The other strengths are fixed; every axis' interval includes that of the common N.
    """
    if N.is_limit:
        return ()
    pairs = [(_without_noise(one, found.mode), _of_axes(one, found.mode)) for one in stretches]

    def low(x: FloatArray) -> float:
        heights = [
            one.evidence_under(rest + np.tensordot(np.exp(2.0 * x), axes, axes=1))
            for one, (rest, axes) in zip(stretches, pairs, strict=True)
        ]
        return float(0.5 * x @ x / AXES_SIGMA**2 - sum(heights))

    best = np.asarray(minimize(low, np.zeros(3), method="L-BFGS-B", options={"eps": 1e-4, "ftol": 1e-7}).x)
    steps = STEP * np.eye(3)
    here = low(best)
    curved = np.array([(low(best + e) + low(best - e) - 2.0 * here) / STEP**2 for e in steps])
    own = 1.0 / np.maximum(curved, 1.0 / AXES_SIGMA**2)
    if 2.0 * (low(np.zeros(3)) - here) + float(np.sum(np.log(own / AXES_SIGMA**2))) < PREFERRED:
        return ()
    common = (0.25 * np.log(N.upper / max(N.lower, N.upper / ABSENT))) ** 2
    each = []
    for x, variance in zip(best, own, strict=True):
        value, factor = N.value * float(np.exp(x)), float(np.exp(NORMAL_95 * np.sqrt(variance + common)))
        each.append(Bounded(value, value / factor, value * factor))
    return tuple(each)


def _without_noise(stretch: Stretch, strengths: FloatArray) -> FloatArray:
    """Covariance (3 m, 3 m) of all random errors except noise and vibration."""
    return stretch.covariance(np.where(np.isin(NAMES, ("noise", "vibration")), 0.0, strengths))


def _of_axes(stretch: Stretch, strengths: FloatArray) -> FloatArray:
    """(3, 3 m, 3 m) covariance of noise and vibration of each body axis, in the reference's world frame."""
    m = len(stretch.time_s)
    h = float(np.median(np.diff(stretch.time_s)))
    per_block = h * (strengths[0] ** 2 + strengths[1] ** 2 * stretch.power)
    earlier = np.minimum.outer(np.arange(m), np.arange(m))
    out = []
    for axis in range(3):
        along = stretch.attitude[:, :, axis]
        added = per_block[:, None, None] * along[:, :, None] * along[:, None, :]
        walk = (np.cumsum(added, axis=0) - 0.5 * added)[earlier]
        own, neighbour = stretch.ends
        at = np.arange(m)
        walk[at, at] -= own * added
        walk[at[1:], at[:-1]] -= neighbour * added[1:]
        walk[at[:-1], at[1:]] -= neighbour * added[1:]
        out.append(walk.transpose(0, 2, 1, 3).reshape(3 * m, 3 * m))
    return np.array(out)
