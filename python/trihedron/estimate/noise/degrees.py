"""Equivalent degrees of freedom of Allan variances by type of noise, and the type along a curve."""

from __future__ import annotations

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.records.noise import AllanKind


def never_falling(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Isotonic regression by pooling adjacent violators."""
    level: list[float] = []
    mass: list[float] = []
    size: list[int] = []
    for value, weight in zip(values.tolist(), weights.tolist(), strict=True):
        level.append(value)
        mass.append(weight)
        size.append(1)
        while len(level) > 1 and level[-2] > level[-1]:
            last, last_mass, last_size = level.pop(), mass.pop(), size.pop()
            level[-1] = (level[-1] * mass[-1] + last * last_mass) / (mass[-1] + last_mass)
            mass[-1] += last_mass
            size[-1] += last_size
    return np.repeat(level, size)


KINDS = {
    "overlapping": _core.AllanKind.Overlapping,
    "non-overlapping": _core.AllanKind.NonOverlapping,
    "modified": _core.AllanKind.Modified,
    "hadamard": _core.AllanKind.Hadamard,
    "total": _core.AllanKind.Total,
}
FEWEST_CLUSTERS = 32
"""Fewest clusters in a log for a slope of its curve."""
TYPES = {
    2: _core.AllanNoise.Quantisation,
    0: _core.AllanNoise.White,
    -1: _core.AllanNoise.Flicker,
    -2: _core.AllanNoise.Walk,
}


def edf_along(n: int, clusters: IntArray, variance: FloatArray, weight: FloatArray, kind: AllanKind) -> FloatArray:
    """(k,) degrees of freedom along a curve; its slopes give the noise type, between types edf is interpolated.

    ``edf = 2 E(V)² / var(V)`` of each type after Greenhall and Riley (2003), docs/noise.md, eq. 6.
    """
    slopes = slopes_along(n, clusters, variance)
    out = np.empty(len(clusters))
    types = list(TYPES.values())
    for i, m in enumerate(clusters.tolist()):
        # Slope of the variance: -2 quantisation, -1 white, 0 flicker, 1 walk.
        place = min(max(slopes[i] + 2.0, 0.0), 3.0)
        below = min(int(place), 2)
        share = place - below
        first, second = (_core.allan_degrees(n, m, types[below + step], KINDS[kind]) for step in (0, 1))
        edf = first ** (1.0 - share) * second**share
        full = max(1, n // m - 1 if kind == "non-overlapping" else n - (3 if kind == "hadamard" else 2) * m + 1)
        # Missing readings reduce the degrees of freedom in proportion.
        lost = weight[i] / full if kind in ("overlapping", "non-overlapping", "hadamard") else 1.0
        out[i] = max(1.0, edf * min(1.0, lost))
    return out


def bias_along(n: int, clusters: IntArray, variance: FloatArray, kind: AllanKind) -> FloatArray:
    """(k,) expectation of a variance over the Allan variance: 1 except for the total variance (docs/noise.md, 2).

    Flicker and walk after Greenhall, Howe and Percival (1999); quantisation: every reflected term contains both ends of
    the phase.
    """
    if kind != "total":
        return np.ones(len(clusters))
    m = clusters.astype(np.float64)
    by_type = np.stack(
        [1.0 + 4.0 / 3.0 * (m - 1.0) / (n - 1.0), np.ones_like(m), 1.0 - 0.481 * m / n, 1.0 - 0.750 * m / n]
    )
    place = np.clip(slopes_along(n, clusters, variance) + 2.0, 0.0, 3.0)
    below = np.minimum(place.astype(np.int64), 2)
    share, rows = place - below, np.arange(len(m))
    return np.asarray(by_type[below, rows] ** (1.0 - share) * by_type[below + 1, rows] ** share)


def slopes_along(n: int, clusters: IntArray, variance: FloatArray) -> FloatArray:
    """(k,) slopes of log variance against log cluster size, non-decreasing.

    A sum of noise terms is convex in these scales; a curve that bends down at its end does so by chance. Without this
    a low value would be taken for quantisation noise, whose values have many degrees of freedom.
    """
    x = np.log2(clusters.astype(np.float64))
    good = np.isfinite(variance) & (variance > 0)
    if np.count_nonzero(good) < 2:
        return np.full(len(x), -1.0)
    xs, ys = x[good], np.log2(variance[good])
    order = np.argsort(xs)
    xs, ys = xs[order], ys[order]
    step = np.diff(xs)
    slope = np.diff(ys) / np.where(step > 0, step, 1.0)
    # Variance of a slope over one step: two neighbouring values of about n/m degrees of freedom, largely the same.
    weight = step**2 * n / 2.0 ** (0.5 * (xs[1:] + xs[:-1]))
    rising = never_falling(slope, np.maximum(weight, 1e-12))
    middle = 0.5 * (xs[1:] + xs[:-1])
    return np.interp(x, middle, _held_at_the_end(rising, middle, n))


def _held_at_the_end(slope: FloatArray, middle: FloatArray, n: int) -> FloatArray:
    """Slopes, constant beyond ``n / FEWEST_CLUSTERS`` readings: with few clusters a curve bends by chance.

    Otherwise a random bend at the end of the curve would determine its own degrees of freedom, always too few.
    """
    reliable = np.flatnonzero(2.0**middle <= n / FEWEST_CLUSTERS)
    if len(reliable) == 0:
        return slope
    return np.asarray(np.minimum(slope, slope[reliable[-1]]))
