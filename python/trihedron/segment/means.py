"""The mean reading of every pose, and its standard error without assuming white noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.records import Pose, Recording
from trihedron.segment.channels import Channels, mean_present
from trihedron.segment.noise import MeanNoise, pool_mean_noise, split_by_halves
from trihedron.segment.runs import Run, means_of
from trihedron.session.rounding import TWO_CODES
from trihedron.transforms import directions_of
from trihedron.units import acceleration_to_si

PIECE = 1 << 18
"""Rows of a pose that are read at a time."""
OCTAVES = 4
"""Octaves that determine a pose's own excess noise, from a half down to a sixteenth of its length: those that matter
for the error of its mean."""
ROUNDS = 8
"""Rounds of common noise and excess; the last changes it by 1.2 % where it was four times as large."""


@dataclass(frozen=True, eq=False)
class PoseMeans:
    """``mean``, ``sigma`` (h, c) raw units; ``n_averaged`` (h,) finite samples.

    ``up`` (h, 3) the accelerometer's vertical, ``sigma_up`` (h,) standard error of the mean along it, or ``None``.
    """

    mean: FloatArray
    sigma: FloatArray
    n_averaged: np.ndarray[tuple[int], np.dtype[np.int64]]
    up: FloatArray | None = None
    sigma_up: FloatArray | None = None


def average_poses(
    recording: Recording, channels: Channels, runs: list[Run], poses: tuple[Pose, ...], noise: PoseNoise
) -> PoseMeans:
    """Means over the samples of each pose; their variances are the pooled ones times the pose's own excess."""
    mean, n_averaged = _sample_means(
        [a for a in (recording.accelerometer, recording.gyroscope) if a is not None], poses
    )
    duration = np.array([sum(b - a for a, b in run.quiet_ranges()) * channels.step_s for run in runs])
    rounding = rounding_bias_variance(channels, runs)
    out = PoseMeans(mean, np.sqrt(noise.variance(duration) + rounding), n_averaged)
    if recording.accelerometer is None or not runs:
        return out
    up = upright(mean[:, :3], has_unit=acceleration_to_si(recording.accelerometer_unit) is not None)
    if up is None:
        return out
    upward = along_verticals(channels, runs, up)
    own = noise_of_poses(upward, runs).variance(duration)[:, 0]
    return replace(out, up=up, sigma_up=np.sqrt(own + up**2 @ rounding[:3]))


@dataclass(frozen=True, eq=False)
class PoseNoise:
    """Noise of means over time that poses have in common, and the ``excess`` (h, c) of each over its variance."""

    common: MeanNoise
    excess: FloatArray

    def variance(self, duration_s: FloatArray) -> FloatArray:
        """(h, c) variance of the mean over the duration (h,) of every pose."""
        return self.common.variance(duration_s[:, None]) * self.excess


def noise_of_poses(channels: Channels, runs: list[Run]) -> PoseNoise:
    """The noise of means and the excess of every pose, each estimated from the other until neither changes.

    The excess is the ratio of a pose's own two-sample variances to the common ones over the four coarsest octaves. It
    is shrunk towards 1 with as many prior degrees of freedom as the scatter of the ratios over poses implies (empirical
    Bayes): Student's t, so that a pose that was rocked is no noise of the others. The ratio of an unsteady pose, which
    is in the common noise only where all are, is used as it is, axis by axis.
    """
    steady = np.array([not run.is_unsteady for run in runs], dtype=bool)
    ranges = [(k, r) for k, run in enumerate(runs) if steady[k] or not steady.any() for r in run.quiet_ranges()]
    if not ranges:
        return PoseNoise(MeanNoise(*np.zeros((3, channels.mean.shape[1]))), np.ones((0, channels.mean.shape[1])))
    owner, parts = [k for k, _ in ranges], [r for _, r in ranges]
    triads = [slice(first, first + 3) for first in range(0, channels.mean.shape[1], 3)]
    # Codes that noise does not change show no excess: an axis with few steps would have no noise but in its poses.
    is_dithered = np.vstack([channels.variance[a:b] for a, b in parts]).mean(axis=0) > TWO_CODES * channels.quantum**2
    noise = pool_mean_noise(channels, parts)
    for _ in range(ROUNDS):
        ratio, freedom = _excess(channels, runs, noise)
        # In poses the axes of a triad have the same excess, which is one number. A tremor differs: it rotates gravity
        # across itself, and leaves the reading along it, which determines |g|, as quiet as ever.
        shrunk = np.hstack([_shrunk(ratio[:, axes], freedom, steady, is_dithered[axes]) for axes in triads])
        noise = pool_mean_noise(channels, parts, excess=np.where(is_dithered, shrunk, 1.0)[owner])
    return PoseNoise(noise, np.where(steady[:, None], shrunk, np.maximum(ratio, 1.0)))


def _shrunk(
    ratio: FloatArray, freedom: FloatArray, steady: npt.NDArray[np.bool_], is_dithered: npt.NDArray[np.bool_]
) -> FloatArray:
    """(h, k) excess of every pose on similar axes, shrunk towards 1; by those with dither, else those that change."""
    seen = is_dithered if is_dithered.any() else ratio.any(axis=0) | ~ratio.any()
    r, nu = ratio[:, seen].mean(axis=1), freedom * np.count_nonzero(seen)
    prior = _prior_freedom(r[steady], nu[steady])
    return np.repeat(((prior + nu * r) / (prior + nu))[:, None], ratio.shape[1], axis=1)


def _sample_means(triads: list[FloatArray], poses: tuple[Pose, ...]) -> tuple[FloatArray, IntArray]:
    """(h, c) means over the samples of each pose, and (h,) finite samples of the sensor that has the fewest."""
    mean = np.zeros((len(poses), len(triads), 3))
    count = np.zeros((len(poses), len(triads)), dtype=np.int64)
    # In pieces, so that a pose of hours is not copied as a whole; a log on disk acts like its arrays.
    pieces = [
        (k, start, min(start + PIECE, last))
        for k, pose in enumerate(poses)
        for first, last in pose.undisturbed()
        for start in range(first, last, PIECE)
    ]
    owner = np.zeros(1, dtype=np.int64)
    for k, start, stop in pieces:
        for j, triad in enumerate(triads):
            rows = np.ascontiguousarray(triad[start:stop], dtype=np.float64)
            found, n = _core.means_by_owner(rows, np.array([[0, stop - start]]), owner, 1)
            if n[0] > 0:
                count[k, j] += n[0]
                mean[k, j] += (found[0] - mean[k, j]) * (n[0] / count[k, j])
    mean[count == 0] = np.nan
    return mean.reshape(len(poses), 3 * len(triads)), count.min(axis=1)


def _excess(channels: Channels, runs: list[Run], noise: MeanNoise) -> tuple[FloatArray, FloatArray]:
    """(h, c) own over pooled variance, and (h,) its degrees of freedom per channel."""
    ranges = [(r, k) for k, run in enumerate(runs) for r in run.quiet_ranges()]
    owner = np.array([k for _, k in ranges], dtype=np.int64)
    halves = split_by_halves(channels.mean, [r for r, _ in ranges])
    coarse = halves.depth < OCTAVES
    pose, square = owner[halves.stretch[coarse]], halves.square[coarse]
    duration = halves.size[coarse, None] * channels.step_s
    expected = noise.variance(duration) + 1e-6 * channels.quantisation_variance
    relative = square / np.where(expected > 0.0, expected, 1.0)
    freedom = np.bincount(pose, minlength=len(runs)).astype(np.float64)
    total = np.column_stack([np.bincount(pose, column, len(runs)) for column in relative.T])
    ratio = np.where(freedom[:, None] > 0.0, total / np.maximum(freedom, 1.0)[:, None], 1.0)
    return ratio, freedom


def _prior_freedom(ratio: FloatArray, freedom: FloatArray) -> float:
    """Prior degrees of freedom of the excess: few where poses differ, many where sampling explains their scatter."""
    seen = freedom > 0.0
    if seen.sum() < 2:
        return 1e3
    # E[(r-1)^2] = 2/ν of sampling + 2/ν0 of real differences; clipping keeps one odd pose from dominating.
    spread = float(np.mean(np.minimum((ratio[seen] - 1.0) ** 2, 4.0)))
    real = spread - float(np.mean(2.0 / freedom[seen]))
    return float(np.clip(2.0 / max(real, 1e-9), 1.0, 1e3))


NORMAL_AT, NORMAL_WEIGHT = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)]), np.array([1.0, 4.0, 1.0]) / 6.0
"""Three nodes and weights for the mean over a normal distribution (Gauss-Hermite)."""
FEWEST_PHASES = 6
"""Number of codes in the poses, spread by an LSB rms or more, from which the places inside an LSB are uniform."""
HARMONICS = np.arange(1, 61)
"""Harmonics of the LSB: with noise of 3 % of an LSB the sixtieth is down to a thousandth."""
NOISE_TRIED = np.concatenate([[0.0], np.linspace(0.03, 1.0, 98)])
"""Noise of one reading, in LSB."""
BIAS_VARIANCE = np.where(
    NOISE_TRIED > 0.0,
    np.sum(np.exp(-4.0 * (np.pi * np.outer(NOISE_TRIED, HARMONICS)) ** 2) / (2.0 * (np.pi * HARMONICS) ** 2), axis=1),
    1.0 / 12.0,
)
"""Variance of the rounding error of a mean, in LSB squared, over all places inside an LSB."""
SEEN_VARIANCE = np.maximum.accumulate(NOISE_TRIED**2 + 1.0 / 12.0 - BIAS_VARIANCE)
"""Variance of the rounded readings about their mean: the noise, plus q²/12, less the rounding error of the mean."""


def _mean_bias(seen: FloatArray) -> float:
    """Rounding variance averaged over the uncertainty of the noise, from the scatter of the variances ``seen`` (n,)."""
    tried = seen.mean() + NORMAL_AT * seen.std() / np.sqrt(len(seen))
    noise = np.interp(np.maximum(tried, 0.0), SEEN_VARIANCE, NOISE_TRIED)
    return float(NORMAL_WEIGHT @ np.interp(noise, NOISE_TRIED, BIAS_VARIANCE))


def left_by_rounding(seen: FloatArray) -> FloatArray:
    """Variance (c,) of the rounding error of a mean at one place in an LSB, by that of the readings ``seen`` (c,), both
    in LSB squared: q²/12 without noise, less in proportion, none where readings reach more than two codes.

    Two codes have a variance of at most q²/4. Above it the mean is off by 0.016 q at most whatever the place; below,
    the proportion is 1 to 1.2 times the rms error over all noises and places that show this variance.
    """
    return np.maximum(1.0 - seen / TWO_CODES, 0.0) / 12.0


def rounding_bias_variance(channels: Channels, runs: list[Run]) -> FloatArray:
    """(c,) rounding variance of a mean that averaging does not reduce, where the noise is too small to dither.

    The mean of a rounded Gaussian of deviation σ is off by the sum over k of (q/πk) exp(-2π²k²σ²/q²) sin(2πkx/q): q/√12
    rms without noise, a fifth of it at σ = 0.28 q (Widrow and Kollár 2008, ch. 4). σ follows from the scatter of the
    readings, which depends on the place in an LSB too: poses far apart have all places, a bias has one.
    """
    if not runs:
        return np.zeros(channels.mean.shape[1])
    parts = [run.quiet_ranges() for run in runs]
    mean = means_of(channels.mean, parts)
    pooled = means_of(channels.variance, [[r for part in parts for r in part]])[0]
    q2 = np.where(channels.quantum > 0.0, channels.quantum**2, 1.0)
    left = left_by_rounding(pooled / q2)
    if len(runs) >= FEWEST_PHASES:
        by_pose = means_of(channels.variance, parts) / q2
        for axis in np.flatnonzero((left > 0.0) & (mean.var(axis=0) > q2)):
            # Poses with one code (a face, turned on its table) count as one place inside the LSB.
            place = np.unique(np.round(mean[:, axis] / np.sqrt(q2[axis])), return_inverse=True)[1]
            n = int(place.max()) + 1
            if n >= FEWEST_PHASES:
                left[axis] = _mean_bias(np.bincount(place, by_pose[:, axis]) / np.bincount(place))
    left = left * q2
    return np.where(channels.quantum > 0.0, left, 0.0)


# The error of a pose's mean along the vertical, the only part that changes the norm of gravity.

FEWEST_ON_ELLIPSOID = 9
"""Poses from which the ellipsoid of their readings (six parameters) is fitted."""
MOST_UNEVEN = 3.0
"""Ratio of the axes' sensitivities above which the ellipsoid is not an accelerometer's: its poses lie in a plane."""
WORST_CONDITION = 50.0
"""Condition number above which poses do not determine its parameters."""


def upright(mean: FloatArray, *, has_unit: bool) -> FloatArray | None:
    """(h, 3) unit gradients of the norm of gravity by the raw means (h, 3) of the accelerometer.

    Normals of the axis-parallel ellipsoid through the means; where they do not determine one, the directions of the
    means if the readings have a unit (biases are then small beside gravity), else ``None``.
    """
    if len(mean) >= FEWEST_ON_ELLIPSOID and np.isfinite(mean).all():
        centre, scale = 0.5 * (mean.max(axis=0) + mean.min(axis=0)), float(np.ptp(mean, axis=0).max())
        if scale > 0.0:
            x = (mean - centre) / scale
            design = np.hstack([x**2, x])
            length = np.linalg.norm(design, axis=0)
            if length.all() and np.linalg.cond(design / length) < WORST_CONDITION:
                found = np.linalg.lstsq(design, np.ones(len(x)), rcond=None)[0]
                square = found[:3]
                if square.min() > 0.0 and square.max() < MOST_UNEVEN**2 * square.min():
                    return directions_of(2.0 * square * x + found[3:])
    return directions_of(mean) if has_unit and np.isfinite(mean).all() and np.any(mean, axis=1).all() else None


def along_verticals(channels: Channels, runs: list[Run], up: FloatArray) -> Channels:
    """The accelerometer's blocks along each pose's own direction ``up`` (h, 3), as the first axis of a triad.

    A soft support, a tremor and settling rotate gravity across itself: readings across the vertical change by the
    angle, that along it by half its square.
    """
    force = np.flatnonzero(~channels.is_gyroscope)
    mean, variance = np.zeros((channels.n_blocks, 3)), np.zeros((channels.n_blocks, 3))
    for run, direction in zip(runs, up, strict=True):
        for a, b in run.quiet_ranges():
            blocks = channels.mean[a:b, force]
            mean[a:b, 0] = (blocks - mean_present(blocks)) @ direction
            variance[a:b, 0] = channels.variance[a:b, force] @ direction**2
    quantum = np.array([float(channels.quantum[force].min()), 0.0, 0.0])
    return replace(channels, mean=mean, variance=variance, quantum=quantum, is_gyroscope=np.zeros(3, dtype=bool))
