"""Zeros that jump inside poses: a step through a pose against a smooth curve (eq. 8.7a)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.linalg import toeplitz

from trihedron.arrays import FloatArray
from trihedron.diagnose.session.observations import Observations

N_BLOCKS, EDGE = 16, 3
"""A pose is seen as so many block means; a step leaves at least so many on either side, so that what the hand's jolt
does in the first block is none."""
SMOOTH = 3
"""Degree of the curve that a step must beat: creep, warm-up and slow noise are smooth."""
LEAST_SAMPLES = 3 * N_BLOCKS
"""Readings of a pose below which its blocks say nothing."""
LOUD = 3.0
"""Variance of the blocks about the step over the usual, from which a pose holds something else than one step."""
COUNTS = 6.0
"""Chi-square by which a step must beat the curve to count: white noise does it in one pose of some hundred."""
TURNS = 4.0
"""How much larger than usual what the other sensor reads at the step marks it as motion (a pose that slips)."""
LAG = 4
"""Blocks between two whose difference, over that of neighbours, says the colour of the noise: squared, 1 when it is
white, 2 for flicker, 5.5 for a walk."""
COLOUR_SPREAD = 0.85
"""Standard deviation of that ratio's logarithm, times the root of the number of poses (drawn for all colours)."""
FLICKER, WALK = (0.0, 0.5, 1.0, 2.0), (0.3, 0.5, 1.0, 4.0)
"""Flicker, or a walk, over white noise of one, that a pool of poses is drawn with."""
N_POOL, N_DRAWS, SEED = 20_000, 20_000, 1
FEWEST_POSES = 12
N_LOOKS = 3
"""Axes."""


@dataclass(frozen=True, eq=False)
class Jumps:
    """``p_value`` (two sensors) of zeros that jump in some poses, ``ratio`` how much larger the steps are than noise
    (as a variance), ``holds`` which: accelerometer, gyro."""

    p_value: tuple[float, float]
    ratio: tuple[float, float]
    poses: tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]


@dataclass(frozen=True, eq=False)
class _Steps:
    """(poses, axes): chi-square by which the best step beats the smooth curve, its block, the variance that it leaves
    per degree of freedom; blocks (poses, blocks, axes) in units of their noise."""

    beats: FloatArray
    at: npt.NDArray[np.intp]
    left: FloatArray
    blocks: FloatArray


@lru_cache(maxsize=4)
def jumps_in_poses(obs: Observations) -> Jumps:
    """Whether some poses are better described by a step than slow noise ever is.

    Noise beats a cubic by a step with a chance that its colour sets: the p-value is that of the colours between white
    and a walk, each weighed by how well it agrees with the differences inside the poses.
    A step at which the other sensor reads a motion is a pose that slipped.
    """
    still = np.array([not pose.is_unsteady for pose in obs.segments.poses])
    still &= np.array([pose.stop - pose.start >= LEAST_SAMPLES for pose in obs.segments.poses])
    which = np.flatnonzero(still)
    p, ratio, poses = [1.0, 1.0], [1.0, 1.0], [np.zeros(0, dtype=np.intp)] * 2
    if len(which) < FEWEST_POSES:
        return Jumps((p[0], p[1]), (ratio[0], ratio[1]), (poses[0], poses[1]))
    sides = [None if raw is None else _block_means(obs, raw, which) for raw in (obs.raw_force, obs.raw_rate)]
    steps = [None if side is None else _steps(side) for side in sides]
    for k, own in enumerate(steps):
        if own is None:
            continue
        other = steps[1 - k]
        counted = np.where((own.left < LOUD) & ~_moved(own, other, k), np.maximum(own.beats - COUNTS, 0.0), 0.0)
        total = counted.sum(axis=0)
        axis = int(total.argmax())
        if total[axis] > 0.0:
            p[k] = min(1.0, N_LOOKS * _chance(len(which), float(total[axis]), _colour(own.blocks[:, :, axis])))
        found = np.flatnonzero(counted[:, axis])
        ratio[k] = 1.0 + float(counted[:, axis].max())
        poses[k] = which[found[np.argsort(-counted[found, axis])]][: max(1, len(which) // 10)]
    return Jumps((p[0], p[1]), (ratio[0], ratio[1]), (poses[0], poses[1]))


def _block_means(obs: Observations, raw: FloatArray, which: npt.NDArray[np.intp]) -> FloatArray:
    """(poses, blocks, axes) means of equal stretches, over the noise that neighbours show, whatever the length."""
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
    # Robust: the median over all poses of squared changes (0.455 of a chi-square's mean), half of it one block's.
    noise = np.sqrt(np.median(change**2, axis=(0, 1)) / 0.4549 / 2.0)
    return np.asarray(blocks / np.where(noise > 0.0, noise, np.inf))


def _steps(blocks: FloatArray) -> _Steps:
    x = blocks - blocks.mean(axis=1, keepdims=True)
    whole = (x**2).sum(axis=1)
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, N_BLOCKS), SMOOTH + 1))
    curve = (np.einsum("nbc,bd->ndc", x, basis) ** 2).sum(axis=1)
    k = np.arange(EDGE, N_BLOCKS - EDGE + 1)
    before = np.cumsum(x, axis=1)[:, k - 1]
    # A step between k and n - k blocks explains S_k²/k + S_k²/(n - k): what is centred sums to nothing.
    step = before**2 * (1.0 / k + 1.0 / (N_BLOCKS - k))[None, :, None]
    best = step.argmax(axis=1)
    explained = step.max(axis=1)
    return _Steps(explained - curve, k[best], (whole - explained) / (N_BLOCKS - 3), x)


def _colour(blocks: FloatArray) -> float:
    """Logarithm of the ratio of squared differences, blocks some apart over neighbours (medians, jumps aside)."""
    near, far = (float(np.median((blocks[:, lag:] - blocks[:, :-lag]) ** 2)) for lag in (1, LAG))
    return float(np.log(far / near))


def _moved(own: _Steps, other: _Steps | None, sensor: int) -> npt.NDArray[np.bool_]:
    """(poses, axes) whether the other sensor sees motion at the step: a change that lasts, of a gyro also a pulse."""
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
    """Of a sum as large in noise whose differences are of this colour."""
    colours, sums = _nulls(n_poses)
    agree = np.exp(-0.5 * n_poses * ((colour - colours) / COLOUR_SPREAD) ** 2)
    larger = (1 + (sums >= total).sum(axis=1)) / (N_DRAWS + 1)
    # Redder than a walk is as red as one.
    return float(agree @ larger / agree.sum()) if agree.sum() > 0.0 else float(larger[-1])


@lru_cache(maxsize=16)
def _nulls(n: int) -> tuple[FloatArray, FloatArray]:
    """(colours,) and (colours, draws): the sum for ``n`` poses of noise of each colour."""
    rng = np.random.default_rng(SEED)
    colours, pools = _pools()
    return colours, np.array([pool[rng.integers(0, len(pool), (N_DRAWS, n))].sum(axis=1) for pool in pools])


@lru_cache(maxsize=1)
def _pools() -> tuple[FloatArray, FloatArray]:
    """(colours,) and (colours, poses): what single poses of every noise count."""
    rng = np.random.default_rng(SEED)
    white, other = rng.normal(size=(2, N_POOL, 4 * N_BLOCKS))
    # 1/f by Kasdin's filter (fractional integration of order one half), and white noise summed up.
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
