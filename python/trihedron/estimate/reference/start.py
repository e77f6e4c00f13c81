"""Initial S and b of a gyro and the clock from rates by windows, for the fit of the whole motion."""

from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import TINY, BoolArray, FloatArray, rms_of
from trihedron.errors import InputError
from trihedron.estimate.reference.clocks import Alignment
from trihedron.estimate.reference.coloured import without_outliers
from trihedron.estimate.reference.together import Grid, Reference, windows_beside
from trihedron.records import Segments
from trihedron.records.reference import FitToReference

TURNS = 4
"""Gauss-Newton steps of the clock: from an error of one sample, three reach a microsecond."""
FEWEST = 20
"""Fewest windows of three components for 14 parameters."""
TURNING = 0.5
"""Least rate of a window that rotates, relative to the rms rate: in a session of poses those of its moves."""
TURNING_RAD_S = np.radians(0.5)
"""Largest rate in a pose: at a higher one gravity changes by 0.01 g in the body frame within a second."""


@dataclass(frozen=True, eq=False)
class Start:
    """``ω = S w' + b`` with the covariance (9, 9) of S, and the ``clock``.

    ``share_left`` is the median residual over the median rate of the windows that rotate: both robust to impacts.
    """

    S: FloatArray
    b: FloatArray
    covariance: FloatArray
    clock: Alignment
    share_left: float

    @property
    def handedness(self) -> float:
        """Sign of det S: -1 where log and reference have frames of opposite handedness."""
        return float(np.sign(np.linalg.det(self.S)))


def start_of(grid: Grid, reference: Reference, seen: BoolArray, clock: Alignment) -> Start:
    """Fit ``ω_reference(t (1 + ε) + τ) = S w' + b`` to windows of both rates where ``seen`` (n,), from ``clock``, which
    commands do not determine better.

    Raises ``InputError`` when there are too few of them.
    """
    has_clock, offset_s, rate = not reference.motion.is_stepwise, clock.offset_s, clock.rate
    windows = windows_beside(grid, reference, seen)
    if len(windows.start) < FEWEST:
        raise InputError("too little motion is known beside the log: fewer windows than the parameters need.")
    raw = windows.of(windows.weight, grid.gyroscope)
    middle = float(np.mean(grid.time_s[windows.middle]))
    since = grid.time_s[windows.middle, None] - middle
    of_S = np.einsum("kj,ab->kabj", raw, np.eye(3)).reshape(-1, 9)
    linear = np.hstack([of_S, np.tile(np.eye(3), (len(raw), 1))])
    for _ in range(TURNS if has_clock else 1):
        rates = reference.rate(grid.time_s * (1.0 + rate) + offset_s)
        target, slope = windows.of(windows.weight, rates), -windows.of(windows.slope, rates)
        columns = [-slope.ravel(), -(slope * since).ravel()] if has_clock else []
        theta, inverse, residual, used = _robust(np.column_stack([linear, *columns]), target.ravel())
        moved, rate_change = theta[12:] if has_clock else (0.0, 0.0)
        offset_s += float(moved - rate_change * middle)
        rate += float(rate_change)
    size = np.linalg.norm(target, axis=1)
    turns = size >= TURNING * rms_of(size)
    left = np.linalg.norm(residual, axis=1)
    variance = float(np.sum(residual[used] ** 2)) / (3 * used.sum() - len(theta))
    share = float(np.median(left[turns]) / max(float(np.median(size[turns])), TINY))
    clock = replace(clock, offset_s=offset_s, rate=rate)
    return Start(theta[:9].reshape(3, 3), theta[9:12], variance * inverse[:9, :9], clock, share)


def _robust(X: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Least squares without outliers: θ, inverse information, residuals (k, 3), rows used (k,)."""
    scale = np.sqrt(np.mean(X**2, axis=0)) + TINY
    used = np.ones(len(y) // 3, dtype=bool)
    for _ in range(2):
        rows = np.repeat(used, 3)
        inverse = np.linalg.pinv((X[rows] / scale).T @ (X[rows] / scale), rcond=1e-14, hermitian=True)
        inverse = inverse / np.outer(scale, scale)
        theta = inverse @ (X[rows].T @ y[rows])
        residual = (y - X @ theta).reshape(-1, 3)
        used = without_outliers(np.linalg.norm(residual, axis=1))
    return theta, inverse, residual, used


def poses_at_rest(segments: Segments, gyroscope: FitToReference, has_own_bias: bool) -> int:
    """Number of static poses: a vehicle in steady flight has constant readings too, but rotates.

    A reference that is another gyro ``has_own_bias``: the median rate of the poses is then bias, not rotation.
    """
    if segments.gyroscope_mean is None:
        return segments.n_poses
    rate = segments.gyroscope_mean @ gyroscope.S.T + gyroscope.b
    if has_own_bias:
        rate = rate - np.median(rate, axis=0)
    return int(np.count_nonzero(np.linalg.norm(rate, axis=1) < TURNING_RAD_S))
