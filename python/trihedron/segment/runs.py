"""From quiet blocks to holds, still counted in blocks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from trihedron.segment.channels import BoolArray, Channels, FloatArray, rolling_mean
from trihedron.segment.floor import Activity
from trihedron.segment.noise import MeanNoise, Range

MIN_HOLD_S = 1.0
"""A hand that hesitates stops for a few tenths of a second; a person who holds, holds a second."""
BUMP_S = 2.0
"""A push and the ringing after it last less than this; what lasts longer is a move even if the pose comes back."""
SAME_POSE = 1e-3
"""Chance that two stretches of one pose are called two poses."""
SWAY_RAD = 0.02
"""About one degree, the tremor and sway of a hand that tries to hold still: an unsteady hold keeps within it."""
TURN_SIGMAS = 6.0
"""A quiet gyro that reads further than this from the common zero, in robust standard deviations, is turning."""


@dataclass(frozen=True)
class Run:
    """Blocks ``[first, last)`` of one hold; ``bumps`` are block ranges inside it that are left out."""

    first: int
    last: int
    bumps: tuple[Range, ...] = ()
    is_unsteady: bool = False
    trimmed: Range = (0, 0)

    @property
    def outer_first(self) -> int:
        """First block before the edges were trimmed."""
        return self.first - self.trimmed[0]

    @property
    def outer_last(self) -> int:
        """Block after the last one before the edges were trimmed."""
        return self.last + self.trimmed[1]

    def quiet_ranges(self) -> list[Range]:
        """The stretches between bumps."""
        edges = [self.first, *(k for bump in self.bumps for k in bump), self.last]
        return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]


def ranges_of(mask: BoolArray) -> list[Range]:
    """Runs of true values as ``[first, last)``."""
    padded = np.concatenate([[False], mask, [False]])
    flips = np.flatnonzero(padded[1:] != padded[:-1])
    return [(int(a), int(b)) for a, b in zip(flips[::2], flips[1::2], strict=True)]


def loose_blocks(activity: Activity, is_valid: BoolArray) -> BoolArray:
    """Blocks nearer to stillness than to the log's own moves: below half of the moves' level, on the log scale."""
    moving = ~activity.is_quiet & is_valid
    if not moving.any():
        return activity.is_quiet.copy()
    loose = activity.is_quiet.copy()
    below = is_valid.copy()
    for level, limit in ((activity.fast, activity.fast_limit), (activity.slow, activity.slow_limit)):
        moves = level[moving & (level > limit)]
        if len(moves):
            below &= level < max(limit, 0.5 * float(np.quantile(moves, 0.9)))
    return loose | below


def turning_blocks(channels: Channels, quiet: BoolArray) -> BoolArray:
    """Quiet blocks in which the gyro reads far from its common zero: a slow steady turn, gravity says nothing of.

    The zero is the median over the quiet windows of one second, its scatter that of the windows or of the holds,
    whichever is larger: a zero that depends on the pose or drifts is no turn.
    """
    out = np.zeros(len(quiet), dtype=bool)
    gyro = np.flatnonzero(channels.is_gyroscope)
    if not len(gyro) or not quiet.any():
        return out
    centre = np.median(channels.mean[quiet][:, gyro], axis=0)
    reading = np.where(channels.is_valid[:, None], channels.mean[:, gyro] - centre, 0.0)
    second = rolling_mean(reading, channels.blocks(1.0))
    holds = [np.median(reading[a:b], axis=0) for a, b in ranges_of(quiet) if b - a >= channels.blocks(MIN_HOLD_S)]
    zero = np.median(second[quiet], axis=0)
    scatter = _scatter(second[quiet])
    if len(holds) > 1:
        scatter = np.maximum(scatter, _scatter(np.array(holds)))
    scatter = np.maximum(scatter, channels.quantum[gyro] / np.sqrt(12.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.nan_to_num(np.abs(second - zero) / scatter, nan=0.0)
    turning: BoolArray = quiet & (distance > TURN_SIGMAS).any(axis=1)
    return turning


def _scatter(values: FloatArray) -> FloatArray:
    out: FloatArray = 1.4826 * np.median(np.abs(values - np.median(values, axis=0)), axis=0)
    return out


def join_quiet(channels: Channels, quiet: BoolArray, loose: BoolArray, noise: MeanNoise) -> list[Run]:
    """Holds from quiet stretches: neighbours in one pose, with only a bump between, are one hold."""
    runs: list[Run] = []
    shortest = channels.blocks(MIN_HOLD_S)
    # Half a hold must show the pose before a neighbour is compared with it.
    for first, last in ranges_of(quiet):
        piece = Run(first, last)
        if runs:
            before = runs[-1]
            gap = (first - before.last) * channels.step_s
            if (gap <= BUMP_S or loose[before.last : first].all()) and _is_same_pose(channels, before, piece, noise):
                runs[-1] = Run(before.first, last, (*before.bumps, (before.last, first)))
                continue
        runs.append(piece)
    return [run for run in runs if sum(b - a for a, b in run.quiet_ranges()) >= shortest]


def _is_same_pose(channels: Channels, before: Run, after: Run, noise: MeanNoise) -> bool:
    difference = np.zeros(channels.mean.shape[1])
    variance = np.zeros_like(difference)
    for sign, run in ((-1.0, before), (1.0, after)):
        mean, blocks = run_mean(channels, run)
        difference += sign * mean
        variance += noise.variance(blocks * channels.step_s)
    variance += 2.0 * channels.quantisation_variance
    live = variance > 0.0
    statistic = float(np.sum(difference[live] ** 2 / variance[live]))
    return statistic < float(stats.chi2.isf(SAME_POSE, int(live.sum())))


def run_mean(channels: Channels, run: Run) -> tuple[FloatArray, int]:
    """(c,) mean reading of the quiet blocks of a run, and how many they are."""
    blocks = np.vstack([channels.mean[a:b] for a, b in run.quiet_ranges()])
    return blocks.mean(axis=0), len(blocks)


def find_unsteady(channels: Channels, loose: BoolArray, steady: list[Run], gravity: float | None) -> list[Run]:
    """Holds that never come down to the noise floor: long calm stretches whose attitude stays within a hand's sway.

    ``gravity`` is the accelerometer's reading of |g| in raw units; without it an angle has no scale, and none is found.
    """
    accelerometer = ~channels.is_gyroscope
    if gravity is None or not accelerometer.any():
        return []
    free = loose.copy()
    for run in steady:
        # A calm fringe of a steady hold is its settling, not another pose.
        a, b = run.first, run.last
        while a > 0 and free[a - 1]:
            a -= 1
        while b < len(free) and free[b]:
            b += 1
        free[a:b] = False
    found = []
    for first, last in ranges_of(free):
        if last - first < channels.blocks(MIN_HOLD_S):
            continue
        sway = np.linalg.norm(channels.mean[first:last][:, accelerometer].std(axis=0)) / gravity
        if sway < SWAY_RAD:
            found.append(Run(first, last, (), True))
    return found


def trim_edges(channels: Channels, run: Run, noise: MeanNoise) -> Run:
    """Take blocks off both ends until no stretch at an end departs from the middle of the hold.

    Stretches of 1, 2, 4 ... blocks at each end are compared with the central half; at most a third is taken off.
    """
    n = run.last - run.first
    centre = np.zeros(n, dtype=bool)
    centre[n // 4 : n - n // 4] = True
    good = np.ones(n, dtype=bool)
    for a, b in run.bumps:
        good[a - run.first : b - run.first] = False
    core = centre & good
    if core.sum() < 2:
        core = good
    mean = channels.mean[run.first : run.last]
    level = mean[core].mean(axis=0)
    off = np.where(good[:, None], mean - level, 0.0)
    core_variance = noise.variance(core.sum() * channels.step_s)
    start = _clean_from(off, core_variance, channels, noise, n // 3)
    stop = n - _clean_from(off[::-1], core_variance, channels, noise, n // 3)
    bumps = tuple((a, b) for a, b in run.bumps if b > run.first + start and a < run.first + stop)
    bumps = tuple((max(a, run.first + start), min(b, run.first + stop)) for a, b in bumps)
    return replace(run, first=run.first + start, last=run.first + stop, bumps=bumps, trimmed=(start, n - stop))


def _clean_from(off: FloatArray, core_variance: FloatArray, channels: Channels, noise: MeanNoise, most: int) -> int:
    total = np.vstack([np.zeros(off.shape[1]), np.cumsum(off, axis=0)])
    sizes = [2**k for k in range(16) if 2**k <= most]
    live = np.flatnonzero(noise.variance(1.0) > 0.0)
    limit = float(stats.chi2.isf(SAME_POSE, len(live)))
    dirty = np.zeros(most + 1, dtype=bool)
    for size in sizes:
        variance = noise.variance(size * channels.step_s) + core_variance + channels.quantisation_variance
        mean = (total[size : size + most + 1] - total[: most + 1][: len(total) - size]) / size
        statistic = (mean[:, live] ** 2 / variance[live]).sum(axis=1)
        dirty[: len(statistic)] |= statistic > limit
    clean = np.flatnonzero(~dirty)
    return int(clean[0]) if len(clean) else most
