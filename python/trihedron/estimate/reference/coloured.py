"""Least squares with coloured residuals: of several noise models, the one whose estimates repeat best between blocks.

A tracker's noise is blue, a table's wobble has lines, a bias drifts, and all of it grows with motion. A wrong noise
model can make an estimate worse than ordinary least squares; a jackknife over blocks of time selects the model.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from trihedron.arrays import TINY, BoolArray, FloatArray, IntArray, rms_of
from trihedron.errors import InputError

ORDERS = (0, 2, 12)
"""Orders of the autoregression that are tried: none; one slope or line; wobble with some lines (two poles each)."""
ROWS_PER_POLE = 15
"""Fewest rows per order of an autoregression: p lags cost 1/15 of its variance."""
OUTLIER = 7.0
"""Residuals beyond 7 robust sigmas, and their neighbours, are excluded: p = 1/4e11 for a normal residual."""
BLOCKS = 16
"""Blocks of time of the jackknife. With 16 the pooled variance ratio of 12 parameters scatters by 10 %."""
MOST_STRETCHES = 100
"""Most stretches that are taken for plateaus of a table; more are gaps of a bad log."""
MOST_OUT = 0.2
"""Largest share of outliers: with more the robust sigma is wrong, and none is excluded."""


@dataclass(frozen=True)
class NoiseModel:
    """Whether the noise grows with the motion, and the order of its autoregression."""

    grows: bool
    order: int


@dataclass(frozen=True, eq=False)
class Solution:
    """θ (p,), covariance (p, p), unweighted residuals (k, 3), rows used (k,), and rms of held-out rows.

    ``influence`` (p, k, 3): derivative of θ by each row of the target; ``widened``: median factor on the errors.
    """

    theta: FloatArray
    covariance: FloatArray
    influence: FloatArray
    residual: FloatArray
    is_used: BoolArray
    widened: float
    rms_held_out: float
    model: NoiseModel


def solve(design: FloatArray, target: FloatArray, index: IntArray, size: FloatArray) -> Solution:
    """Estimate θ of ``target (k, 3) = design (k, 3, p) θ``.

    ``index`` (k,) numbers the windows, gaps included; ``size`` (k,) is the motion with which noise may grow. Raises
    ``InputError`` when there are too few rows for the parameters.
    """
    k, _, p = design.shape
    if 3 * k < 2 * p + 30:
        raise InputError("too little motion is known beside the log: fewer windows than the parameters need.")
    scale = np.sqrt(np.mean(design**2, axis=(0, 1)))
    scale[scale == 0.0] = 1.0
    X = design / scale
    best: tuple[float, Solution] | None = None
    for one in (NoiseModel(grows, order) for grows in (False, True) for order in ORDERS):
        if one.order * ROWS_PER_POLE > k:
            continue
        spread, solution = _solve(X, target, index, size, one)
        if best is None or spread < best[0]:
            best = spread, solution
    assert best is not None
    found = best[1]
    theta, covariance = found.theta / scale, found.covariance / np.outer(scale, scale)
    return replace(found, theta=theta, covariance=covariance, influence=found.influence / scale[:, None, None])


def _solve(
    X: FloatArray, target: FloatArray, index: IntArray, size: FloatArray, model: NoiseModel
) -> tuple[float, Solution]:
    """The solution under one noise model, and its scatter between blocks (mean log variance)."""
    k, _, p = X.shape
    used = np.ones(k, dtype=bool)
    weight = np.ones(k)
    flat = X.reshape(-1, p)
    theta = _least_squares(flat, target.ravel())
    for _ in range(2):
        r = target - X @ theta
        weight = _weights(r, size, used) if model.grows else np.ones(k)
        length = np.linalg.norm(r * weight[:, None], axis=1)
        used = without_outliers(length)
        rows = np.repeat(used, 3)
        w = np.repeat(weight, 3)[rows]
        theta = _least_squares(flat[rows] * w[:, None], target.ravel()[rows] * w)
    for _ in range(2 if model.order else 1):
        r = (target - X @ theta) * weight[:, None]
        filters = [_autoregression(r[:, axis], index, used, model.order) for axis in range(3)]
        white, at = _whitening(index, used, filters)
        white = white * np.repeat(weight, 3)
        Z, y = white @ flat, white @ target.ravel()
        theta = _least_squares(Z, y)
    left = y - Z @ theta
    variance = float(left @ left) / max(len(left) - p - 3 * model.order, 1)
    inverse = np.linalg.pinv(Z.T @ Z, hermitian=True)
    jackknife, held_out = _by_blocks(X, target, index, used, Z, y, at, theta)
    predicted = variance * np.diag(inverse)
    is_known = (predicted > 0.0) & (jackknife > 0.0)
    # Mean of the parameter's own ratio and the median over all: sixteen blocks determine a variance to a third.
    ratio = np.ones(p)
    ratio[is_known] = jackknife[is_known] / predicted[is_known]
    wide = np.sqrt(np.maximum(0.5 * (ratio + np.median(ratio)), 1.0))
    widened = float(np.median(wide))
    spread = float(np.mean(np.log(np.maximum(jackknife, predicted)[is_known]))) if np.any(is_known) else np.inf
    covariance = variance * inverse * np.outer(wide, wide)
    influence = (white.T @ (Z @ inverse)).T.reshape(p, k, 3)
    return spread, Solution(theta, covariance, influence, target - X @ theta, used, widened, held_out, model)


def _least_squares(X: FloatArray, y: FloatArray) -> FloatArray:
    normal = X.T @ X
    return np.linalg.pinv(normal, rcond=1e-14, hermitian=True) @ (X.T @ y)


def _weights(r: FloatArray, size: FloatArray, used: BoolArray) -> FloatArray:
    """Weights (k,), the inverse of the noise σ of each row, whose square grows linearly with the squared motion."""
    square = np.sum(r**2, axis=1)
    order = np.argsort(size[used])
    parts = np.array_split(np.flatnonzero(used)[order], 8)
    # The ratio of median to mean of the squares is the same in every part.
    level = np.array([np.median(square[part]) for part in parts])
    at = np.array([np.mean(size[part] ** 2) for part in parts])
    slope = max(float(np.polyfit(at, level, 1)[0]), 0.0) if np.ptp(at) > 0.0 else 0.0
    floor = max(float(np.median(np.maximum(level - slope * at, 0.0))), 0.05 * float(level.mean()), TINY)
    scale = np.sqrt(floor + slope * size**2)
    return np.asarray(np.median(scale) / scale, dtype=np.float64)


def without_outliers(length: FloatArray) -> BoolArray:
    """Which of residuals of three components, of these lengths (k,), are neither outliers nor beside one."""
    limit = OUTLIER * float(np.median(length)) / 1.538  # the median length of three standard normals
    odd = length > limit
    if odd.mean() > MOST_OUT:
        return np.ones(len(length), dtype=bool)
    near = odd.copy()
    near[1:] |= odd[:-1]
    near[:-1] |= odd[1:]
    return ~near


def _autoregression(r: FloatArray, index: IntArray, used: BoolArray, order: int) -> FloatArray:
    """Whitening filter (order + 1,): 1, then minus the coefficients of the lags, divided by the innovation's σ."""
    rows = _with_past(index, used, order)
    if order == 0 or len(rows) < 3 * order:
        return np.array([1.0 / max(rms_of(r[used]), TINY)])
    past = np.column_stack([r[rows - lag] for lag in range(1, order + 1)])
    phi = _least_squares(past, r[rows])
    sigma = float(np.sqrt(np.sum((r[rows] - past @ phi) ** 2) / max(len(rows) - order, 1)))
    return np.concatenate([[1.0], -phi]) / max(sigma, TINY)


def _with_past(index: IntArray, used: BoolArray, order: int) -> IntArray:
    """Rows with all ``order`` predecessors used and no gap between."""
    rows = np.arange(order, len(index))
    near = index[rows] - index[rows - order] == order
    bad = np.concatenate([[0], np.cumsum(~used)])
    return np.asarray(rows[near & (bad[rows + 1] == bad[rows - order])], dtype=np.int64)


def _whitening(index: IntArray, used: BoolArray, filters: list[FloatArray]) -> tuple[csr_array, IntArray]:
    """Matrix (m, 3 k) that whitens rows (k, 3) in order, and the window (m,) of each whitened row."""
    values, columns, lengths, rows_of = [], [], [], []
    for axis, f in enumerate(filters):
        rows = _with_past(index, used, len(f) - 1)
        values.append(np.tile(f, len(rows)))
        columns.append((3 * (rows[:, None] - np.arange(len(f))) + axis).ravel())
        lengths.append(np.full(len(rows), len(f)))
        rows_of.append(rows)
    first = np.concatenate([[0], np.cumsum(np.concatenate(lengths))])
    of = np.concatenate(values), np.concatenate(columns), first
    return csr_array(of, shape=(len(first) - 1, 3 * len(index))), np.concatenate(rows_of)


def _blocks(index: IntArray) -> IntArray:
    """(k,) block number of each row: stretches between gaps (a table's plateaus), or equal parts."""
    k = len(index)
    stretch = np.concatenate([[0], np.cumsum(np.diff(index) > 1)])
    if BLOCKS // 2 <= stretch[-1] < MOST_STRETCHES:
        return np.asarray(stretch, dtype=np.int64)
    return np.minimum(np.arange(k) * BLOCKS // k, BLOCKS - 1)


def _by_blocks(
    X: FloatArray, target: FloatArray, index: IntArray, used: BoolArray, Z: FloatArray, y: FloatArray, rows: IntArray,
    theta: FloatArray,
) -> tuple[FloatArray, float]:  # fmt: skip
    """Jackknife variances (p,) over blocks of time, and unweighted rms of the held-out rows."""
    block = _blocks(index)
    normal, moment = Z.T @ Z, Z.T @ y
    moved, error, n = [], 0.0, 0
    for one in range(int(block[-1]) + 1):
        out = block[rows] == one
        if not np.any(out):
            continue
        without = normal - Z[out].T @ Z[out]
        if np.linalg.cond(without) > 1e12:
            continue
        other = np.linalg.solve(without, moment - Z[out].T @ y[out])
        moved.append(other - theta)
        seen = used & (block == one)
        error += float(np.sum((target[seen] - X[seen] @ other) ** 2))
        n += 3 * int(seen.sum())
    if len(moved) < 4:
        return np.zeros(X.shape[2]), float("nan")
    d = np.array(moved)
    d -= d.mean(axis=0)
    m = len(d)
    return np.asarray((m - 1) / m * np.sum(d**2, axis=0)), float(np.sqrt(error / max(n, 1)))
