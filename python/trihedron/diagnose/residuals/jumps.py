"""Biases that jump inside poses: steps that stand out from those of the noise, whatever its colour (eq. 8.7a)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import bdtrc, ndtr

from trihedron.arrays import FloatArray
from trihedron.diagnose.session.observations import Observations
from trihedron.probability import MEDIAN_CHI2

N_BLOCKS, BESIDE = 16, 3
"""Block means per pose, and how many on either side of a step: a jolt is in one of them."""
SMOOTH = 3
"""Degree of the polynomial subtracted from every pose: settling, warm-up and slow noise are smooth."""
TURNS = 3.0
"""Step of the other sensor, in its own noise, from which a step is motion (a pose slips)."""
FEWEST_POSES = 12
"""Poses that give the noise of a step to a tenth: eleven places in each, of which four are independent."""


@dataclass(frozen=True, eq=False)
class Jumps:
    """``p_value`` of a sensor's steps, ``ratio`` of the largest's square to noise, ``poses`` with such steps."""

    p_value: float
    ratio: float
    poses: npt.NDArray[np.intp]


@lru_cache(maxsize=4)
def jumps_in_poses(obs: Observations) -> tuple[Jumps, ...]:
    """Of every sensor: whether its bias steps further inside some poses than normal noise of its own colour does.

    The noise of a step is the robust scatter of all steps: of white noise, 1/f noise and a walk alike they are normal.
    A step at which the other sensor steps too is a pose that slipped.
    """
    poses = obs.segments.poses
    long = [not pose.is_unsteady and pose.stop - pose.start >= BESIDE * N_BLOCKS for pose in poses]
    which = np.flatnonzero(long)
    sides = [raw for raw in (obs.raw_force, obs.raw_rate) if raw is not None and len(which) >= FEWEST_POSES]
    steps = [_steps([raw[poses[i].samples()] for i in which]) for raw in sides]
    out = []
    for k, own in enumerate(steps):
        others = [other.max(axis=2, keepdims=True) for j, other in enumerate(steps) if j != k]
        moved = np.any([other > TURNS for other in others], axis=0) if others else np.zeros_like(own, dtype=bool)
        z = np.where(moved, 0.0, own)
        each = np.minimum(2.0 * ndtr(-z.max(axis=(1, 2))) * z[0].size, 1.0)
        out.append(Jumps(_of_several(each), float(z.max() ** 2), which[each * len(which) < 0.5]))
    return tuple(out)


def _of_several(p_values: FloatArray) -> float:
    """p-value of the least likely number of small ones among independent p-values, at most a quarter of them."""
    few = np.sort(p_values)[: len(p_values) // 4]
    return float(min(1.0, len(few) * bdtrc(np.arange(len(few)), len(p_values), few).min()))


def _steps(poses: list[FloatArray]) -> FloatArray:
    """(poses, places, axes) size of a step at every place of a pose beside a smooth curve, in the noise of steps."""
    blocks = []
    for readings in poses:
        values = readings[np.isfinite(readings).all(axis=1)]
        parts = [part.mean(axis=0) for part in np.array_split(values, N_BLOCKS)]
        blocks.append(np.sqrt(len(values)) * np.array(parts))  # white noise is alike in poses of any length
    curve, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, N_BLOCKS), SMOOTH + 1))
    x = (np.eye(N_BLOCKS) - curve @ curve.T) @ np.array(blocks)
    means = sliding_window_view(x, BESIDE, axis=1).mean(axis=-1)
    steps = np.abs(means[:, BESIDE:] - means[:, :-BESIDE])
    noise = np.sqrt(np.median(steps**2, axis=(0, 1)) / MEDIAN_CHI2[1])
    return np.asarray(steps / np.where(noise > 0.0, noise, np.inf))
