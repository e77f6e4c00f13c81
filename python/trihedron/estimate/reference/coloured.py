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
MOST_OUT = 0.2
"""Largest share of outliers: with more the robust sigma is wrong, and none is excluded."""


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


def solve(design: FloatArray, target: FloatArray, index: IntArray, size: FloatArray | None = None) -> Solution:
    """Estimate θ of ``target (k, 3) = design (k, 3, p) θ``.

    ``index`` (k,) numbers the windows, gaps included; ``size`` (k,) is the motion with which noise may grow, without
    which it is white and constant. Raises ``InputError`` when there are too few rows for the parameters.
    """
    k, _, p = design.shape
    if 3 * k < 2 * p + 30:
        raise InputError("too little motion is known beside the log: fewer windows than the parameters need.")
    scale = np.sqrt(np.mean(design**2, axis=(0, 1)))
    scale[scale == 0.0] = 1.0
    X = design / scale
    orders = [order for order in ORDERS if order * ROWS_PER_POLE <= k]
    models = [(None, 0)] if size is None else [(motion, order) for motion in (None, size) for order in orders]
    found = min((_solve(X, target, index, *one) for one in models), key=lambda one: one[0])[1]
    theta, covariance = found.theta / scale, found.covariance / np.outer(scale, scale)
    return replace(found, theta=theta, covariance=covariance, influence=found.influence / scale[:, None, None])


def _solve(
    X: FloatArray, target: FloatArray, index: IntArray, size: FloatArray | None, order: int
) -> tuple[float, Solution]:
    """Scatter between blocks (mean log variance) and the solution under noise that grows with the motion ``size`` (k,),
    if given, and its autoregression of an ``order``."""
    k, _, p = X.shape
    used = np.ones(k, dtype=bool)
    weight = np.ones(k)
    flat = X.reshape(-1, p)
    theta = _least_squares(flat, target.ravel())
    for _ in range(2):
        r = target - X @ theta
        weight = np.ones(k) if size is None else _weights(r, size, used)
        length = np.linalg.norm(r * weight[:, None], axis=1)
        used = without_outliers(length)
        rows = np.repeat(used, 3)
        w = np.repeat(weight, 3)[rows]
        theta = _least_squares(flat[rows] * w[:, None], target.ravel()[rows] * w)
    for _ in range(2 if order else 1):
        r = (target - X @ theta) * weight[:, None]
        filters = [_autoregression(r[:, axis], index, used, order) for axis in range(3)]
        white, at = _whitening(index, used, filters)
        Z, y = white @ (flat * np.repeat(weight, 3)[:, None]), white @ (target * weight[:, None]).ravel()
        theta = _least_squares(Z, y)
    left = y - Z @ theta
    variance = float(left @ left) / max(len(left) - p - 3 * order, 1)
    inverse = np.linalg.pinv(Z.T @ Z, hermitian=True)
    residual = target - X @ theta
    jackknife, held_out = _by_blocks(X, residual, used, Z, left, at)
    predicted = variance * np.diag(inverse)
    is_known = (predicted > 0.0) & (jackknife > 0.0)
    # Mean of the parameter's own ratio and the median over all: sixteen blocks determine a variance to a third.
    ratio = np.ones(p)
    ratio[is_known] = jackknife[is_known] / predicted[is_known]
    wide = np.sqrt(np.maximum(0.5 * (ratio + np.median(ratio)), 1.0))
    widened = float(np.median(wide))
    spread = float(np.mean(np.log(np.maximum(jackknife, predicted)[is_known]))) if np.any(is_known) else np.inf
    covariance = variance * inverse * np.outer(wide, wide)
    influence = (white.T @ (Z @ inverse)).T.reshape(p, k, 3) * weight[:, None]
    return spread, Solution(theta, covariance, influence, residual, used, widened, held_out)


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


def _by_blocks(
    X: FloatArray, residual: FloatArray, used: BoolArray, Z: FloatArray, left: FloatArray, rows: IntArray
) -> tuple[FloatArray, float]:
    """Jackknife variances (p,) over blocks of time, and unweighted rms of the held-out rows, from the ``residual``
    (k, 3) of all and ``left`` of the whitened rows ``Z``, which are those of the windows ``rows``."""
    block = np.arange(len(X)) * BLOCKS // len(X)
    normal = Z.T @ Z
    moved, error, n = [], 0.0, 0
    for one in range(BLOCKS):
        out = block[rows] == one
        without = normal - Z[out].T @ Z[out]
        if not np.any(out) or np.linalg.cond(without) > 1e12:
            continue
        moved.append(-np.linalg.solve(without, Z[out].T @ left[out]))
        seen = used & (block == one)
        error += float(np.sum((residual[seen] - X[seen] @ moved[-1]) ** 2))
        n += 3 * int(seen.sum())
    if len(moved) < 4:
        return np.zeros(X.shape[2]), float("nan")
    m = len(moved)
    return np.asarray((m - 1) * np.var(moved, axis=0)), float(np.sqrt(error / max(n, 1)))
