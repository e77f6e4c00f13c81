"""Initial S and b of a gyro and the clock from rates by windows, for the fit of the whole motion."""

from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import TINY, BoolArray, FloatArray, rms_of
from trihedron.estimate.reference.clocks import Alignment
from trihedron.estimate.reference.coloured import solve
from trihedron.estimate.reference.together import Grid, Reference, windows_beside
from trihedron.records import Segments
from trihedron.records.reference import FitToReference

TURNS = 4
"""Gauss-Newton steps of the clock: from an error of one sample, three reach a microsecond."""
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
    raw = windows.of(windows.weight, grid.gyroscope)
    middle = grid.time_s[len(seen) // 2]
    since = grid.time_s[windows.middle, None] - middle
    of_S = np.einsum("kj,ab->kabj", raw, np.eye(3)).reshape(-1, 3, 9)
    linear = np.concatenate([of_S, np.tile(np.eye(3), (len(raw), 1, 1))], axis=2)
    for _ in range(TURNS if has_clock else 1):
        rates = reference.rate(grid.time_s * (1.0 + rate) + offset_s)
        target, change = windows.of(windows.weight, rates), windows.of(windows.slope, rates)
        by_clock = np.stack([change, change * since], axis=2) if has_clock else np.zeros((len(raw), 3, 0))
        found = solve(np.concatenate([linear, by_clock], axis=2), target, windows.start // windows.spacing)
        moved, rate_change = found.theta[12:] if has_clock else (0.0, 0.0)
        offset_s += float(moved - rate_change * middle)
        rate += float(rate_change)
    size = np.linalg.norm(target, axis=1)
    turns = size >= TURNING * rms_of(size)
    left = np.linalg.norm(found.residual, axis=1)
    share = float(np.median(left[turns]) / max(float(np.median(size[turns])), TINY))
    S, b, covariance = found.theta[:9].reshape(3, 3), found.theta[9:12], found.covariance[:9, :9]
    return Start(S, b, covariance, replace(clock, offset_s=offset_s, rate=rate), share)


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
