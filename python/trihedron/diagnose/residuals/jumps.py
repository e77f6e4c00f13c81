"""Biases that jump inside poses: a step through a pose against a smooth curve (eq. 8.7a)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import toeplitz

from trihedron.arrays import FloatArray
from trihedron.diagnose.session.observations import Observations

N_BLOCKS, EDGE = 16, 3
"""Block means per pose, and least number of them on either side of a step, so that a jolt in the first block is no
step."""
SMOOTH = 3
"""Degree of the polynomial that a step must beat: settling, warm-up and slow noise are smooth."""
LEAST_SAMPLES = 3 * N_BLOCKS
"""Readings of a pose below which its blocks are not used."""
LOUD = 3.0
"""Variance of the blocks about the step over the usual one, above which more than one step is in the pose."""
COUNTS = 6.0
"""Chi-square by which a step must beat the curve to count: white noise does so in about one pose of a hundred."""
TURNS = 4.0
"""Reading of the other sensor at the step, relative to its usual one, from which the step is motion (a pose slips)."""
LAG = 4
"""Distance in blocks whose differences, squared and over those of neighbours, give the colour of the noise: 1 for white
noise, 2 for flicker, 5.5 for a walk."""
COLOUR_SPREAD = 0.85
"""Standard deviation of that ratio's logarithm, times √(number of poses) (simulated for all colours)."""
FLICKER, WALK = (0.0, 0.5, 1.0, 2.0), (0.3, 0.5, 1.0, 4.0)
"""Amplitudes of flicker, or of a walk, over unit white noise that the simulated poses have."""
N_POOL, N_DRAWS, SEED = 20_000, 20_000, 1
FEWEST_POSES = 12
N_LOOKS = 3
"""Axes tested."""


@dataclass(frozen=True, eq=False)
class Jumps:
    """``p_value`` of biases that jump in some poses, ``ratio`` variance of the steps over that of noise, ``poses`` with
    such steps; each for accelerometer, gyro."""

    p_value: tuple[float, float]
    ratio: tuple[float, float]
    poses: tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]


@dataclass(frozen=True, eq=False)
class _Steps:
    """(poses, axes): chi-square by which the best step beats the smooth curve, its block, the remaining variance per
    degree of freedom; blocks (poses, blocks, axes) in units of their noise."""

    beats: FloatArray
    at: npt.NDArray[np.intp]
    left: FloatArray
    blocks: FloatArray


@lru_cache(maxsize=4)
def jumps_in_poses(obs: Observations) -> Jumps:
    """Test whether a step describes some poses better than slow noise can.

    In noise a step beats a cubic by a chance that depends on its colour: the p-value averages over the colours from
    white to a walk, each weighted by its agreement with the differences inside the poses. A step at which the other
    sensor reads a motion is a pose that slipped.
    """
    poses = obs.segments.poses
    which = np.flatnonzero([not pose.is_unsteady and pose.stop - pose.start >= LEAST_SAMPLES for pose in poses])
    none = _Found(1.0, 1.0, np.zeros(0, dtype=np.intp))
    sides = [raw for raw in (obs.raw_force, obs.raw_rate) if raw is not None and len(which) >= FEWEST_POSES]
    steps = [_steps(_block_means(obs, raw, which)) for raw in sides]
    found = [_jumps(own, steps[1 - k] if len(steps) > 1 else None, k, which) for k, own in enumerate(steps)]
    accel, gyro = (*found, none, none)[:2]
    return Jumps((accel.p_value, gyro.p_value), (accel.ratio, gyro.ratio), (accel.poses, gyro.poses))


class _Found(NamedTuple):
    p_value: float
    ratio: float
    poses: npt.NDArray[np.intp]


def _jumps(own: _Steps, other: _Steps | None, sensor: int, which: npt.NDArray[np.intp]) -> _Found:
    counted = np.where((own.left < LOUD) & ~_moved(own, other, sensor), np.maximum(own.beats - COUNTS, 0.0), 0.0)
    total = counted.sum(axis=0)
    axis = int(total.argmax())
    p = 1.0
    if total[axis] > 0.0:
        p = min(1.0, N_LOOKS * _chance(len(which), float(total[axis]), _colour(own.blocks[:, :, axis])))
    found = np.flatnonzero(counted[:, axis])
    poses = which[found[np.argsort(-counted[found, axis])]][: max(1, len(which) // 10)]
    return _Found(p, 1.0 + float(counted[:, axis].max()), poses)


def _block_means(obs: Observations, raw: FloatArray, which: npt.NDArray[np.intp]) -> FloatArray:
    """(poses, blocks, axes) means of equal parts in units of the noise between neighbours, whatever their length."""
    out = []
    for i in which:
        values = raw[obs.segments.poses[i].samples()]
        lasts = np.sqrt(len(values) / obs.recording.rate_hz)
        short, n_longer = divmod(len(values), N_BLOCKS)
        first = short * np.arange(N_BLOCKS) + np.minimum(np.arange(N_BLOCKS), n_longer)
        known = np.isfinite(values)
        present = np.add.reduceat(known, first, axis=0, dtype=np.float64)
        with np.errstate(invalid="ignore"):
            out.append(np.add.reduceat(np.where(known, values, 0.0), first, axis=0) / present * lasts)
    blocks = np.array(out)
    change = np.diff(blocks, axis=1)
    # Robust: the median over all poses of squared differences (0.455 of a chi-square's mean), half of it per block.
    noise = np.sqrt(np.median(change**2, axis=(0, 1)) / 0.4549 / 2.0)
    return np.asarray(blocks / np.where(noise > 0.0, noise, np.inf))


def _steps(blocks: FloatArray) -> _Steps:
    x = blocks - blocks.mean(axis=1, keepdims=True)
    whole = (x**2).sum(axis=1)
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, N_BLOCKS), SMOOTH + 1))
    curve = (np.einsum("nbc,bd->ndc", x, basis) ** 2).sum(axis=1)
    k = np.arange(EDGE, N_BLOCKS - EDGE + 1)
    before = np.cumsum(x, axis=1)[:, k - 1]
    # A step between k and n - k blocks explains S_k²/k + S_k²/(n - k), because the centred blocks sum to zero.
    step = before**2 * (1.0 / k + 1.0 / (N_BLOCKS - k))[None, :, None]
    best = step.argmax(axis=1)
    explained = step.max(axis=1)
    return _Steps(explained - curve, k[best], (whole - explained) / (N_BLOCKS - 3), x)


def _colour(blocks: FloatArray) -> float:
    """Logarithm of the ratio of median squared differences, blocks ``LAG`` apart over neighbours."""
    near, far = (float(np.median((blocks[:, lag:] - blocks[:, :-lag]) ** 2)) for lag in (1, LAG))
    return float(np.log(far / near))


def _moved(own: _Steps, other: _Steps | None, sensor: int) -> npt.NDArray[np.bool_]:
    """(poses, axes) whether the other sensor sees motion at the step: a lasting change, of a gyro also a pulse."""
    if other is None:
        return np.zeros(own.beats.shape, dtype=bool)
    n_poses = len(own.beats)
    rows = np.arange(n_poses)[:, None]
    at = own.at
    before = np.cumsum(other.blocks, axis=1)[rows, at - 1]
    change = before**2 * (1.0 / at + 1.0 / (N_BLOCKS - at))[:, :, None]
    seen = change.max(axis=2)
    out = seen > TURNS**2 * np.maximum(np.median(seen, axis=0), 1.0)
    if sensor == 0:
        pulse = np.maximum(np.abs(other.blocks[rows, at - 1]), np.abs(other.blocks[rows, at])).max(axis=2)
        out |= pulse > TURNS * np.maximum(np.median(pulse, axis=0), 1.0)
    return np.asarray(out)


def _chance(n_poses: int, total: float, colour: float) -> float:
    """Probability of a sum as large in noise whose differences have this colour."""
    colours, sums = _nulls(n_poses)
    agree = np.exp(-0.5 * n_poses * ((colour - colours) / COLOUR_SPREAD) ** 2)
    larger = (1 + (sums >= total).sum(axis=1)) / (N_DRAWS + 1)
    # Noise redder than a walk is treated as a walk.
    return float(agree @ larger / agree.sum()) if agree.sum() > 0.0 else float(larger[-1])


@lru_cache(maxsize=16)
def _nulls(n: int) -> tuple[FloatArray, FloatArray]:
    """(colours,) and (colours, draws): simulated sums for ``n`` poses of noise of each colour."""
    rng = np.random.default_rng(SEED)
    colours, pools = _pools()
    return colours, np.array([pool[rng.integers(0, len(pool), (N_DRAWS, n))].sum(axis=1) for pool in pools])


@lru_cache(maxsize=1)
def _pools() -> tuple[FloatArray, FloatArray]:
    """(colours,) and (colours, poses): simulated contributions of single poses of every noise."""
    rng = np.random.default_rng(SEED)
    white, other = rng.normal(size=(2, N_POOL, 4 * N_BLOCKS))
    # 1/f noise by Kasdin's filter (fractional integration of order one half); the walk is summed white noise.
    taps = np.ones(4 * N_BLOCKS)
    for j in range(1, len(taps)):
        taps[j] = taps[j - 1] * (j - 0.5) / j
    flicker, walk = other @ toeplitz(taps, np.zeros(len(taps))).T, np.cumsum(other, axis=1)
    colours, counts = [], []
    for series in (*(white + c * flicker for c in FLICKER), *(white + c * walk for c in WALK)):
        blocks = series.reshape(N_POOL, N_BLOCKS, 4).mean(axis=2)
        steps = _steps((blocks / np.sqrt(np.median(np.diff(blocks, axis=1) ** 2) / 0.4549 / 2.0))[:, :, None])
        colours.append(_colour(blocks))
        counts.append(np.where(steps.left < LOUD, np.maximum(steps.beats - COUNTS, 0.0), 0.0)[:, 0])
    return np.array(colours), np.array(counts)
