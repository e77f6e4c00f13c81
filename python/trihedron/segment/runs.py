"""From quiet blocks to poses, still counted in blocks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core, probability
from trihedron.arrays import BoolArray, FloatArray
from trihedron.quantiles import medians, quantile, quantiles
from trihedron.ranges import Range, grown, ranges_of
from trihedron.segment.channels import WINDOW_BLOCKS, Channels
from trihedron.segment.floor import Activity
from trihedron.segment.noise import MeanNoise

MIN_POSE_S = 1.0
"""A hand that hesitates stops for a few tenths of a second; a person who holds, holds a second."""
SEEN_S = 0.8
"""What is left to see of the shortest pose at the noise floor: its ends share their blocks with the moves."""
SET_DOWN_S = 0.5
"""A sensor set down for a second comes to rest, and leaves, in less than this; a hand that calms down takes longer."""
FAR_SHORTER = 0.1
"""Of the usual pose: who holds for half a minute does not set down for a second, but hesitates."""
BUMP_S = 2.0
"""A push and the ringing after it last less than this; what lasts longer is a move even if the pose comes back."""
RETURN = 0.3
"""A push and its return cancel: what is left of the turn is less than this part of the way turned to and fro."""
CLEAN_EDGE = 2e-3
"""Chance that a clean stretch at an end is trimmed, where it costs some tenths of a second."""
EDGE_BLOCKS = [2**k for k in range(16)]
"""Stretches at an end of a pose that are compared with its middle."""
CREEP_PART = 0.02
"""A settling support turns slower than this part of the speed of the log's own moves."""
SAME_POSE = 1e-3
"""Chance that two stretches of one pose are called two poses."""
SWAY_RAD = 0.02
"""About one degree, the tremor and sway of a hand that tries to hold still: an unsteady pose keeps within it."""
ONE_WAY = 0.5
"""Share of a hand's mean square rate above which its straight line makes it a turn: over half of it in a slow move and
in its pauses, next to nothing in a tremor of several swings."""


@dataclass(frozen=True)
class Run:
    """Blocks ``[first, last)`` of one pose; ``bumps`` are block ranges inside it that are excluded."""

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
        if not self.bumps:
            return [(self.first, self.last)] if self.last > self.first else []
        edges = [self.first, *(k for bump in self.bumps for k in bump), self.last]
        return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]

    def quiet_rows(self, values: FloatArray) -> FloatArray:
        """(k, c) of one row a block ``values`` (m, c): those between bumps; a view where there are none."""
        parts = [values[a:b] for a, b in self.quiet_ranges()]
        return parts[0] if len(parts) == 1 else np.vstack(parts)


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
            below &= level < max(limit, 0.5 * quantile(moves, 0.9))
    return loose | below


def close_gaps(quiet: BoolArray, is_valid: BoolArray) -> BoolArray:
    """Quiet blocks with gaps shorter than a window closed: a true disturbance lifts every window it lies in."""
    out = quiet.copy()
    for first, last in ranges_of(~quiet):
        if first > 0 and last < len(quiet) and last - first < WINDOW_BLOCKS and is_valid[first:last].all():
            out[first:last] = True
    return out


def widen(quiet: BoolArray, is_valid: BoolArray) -> BoolArray:
    """The whole of the quiet windows: a quiet block is the centre of one, which reaches further on either side."""
    kernel = np.ones(2 * (WINDOW_BLOCKS // 2) + 1)
    return (np.convolve(quiet.astype(np.float64), kernel, mode="same") > 0.5) & is_valid


def speed_of_moves(channels: Channels, quiet: BoolArray) -> float:
    """Gyro reading of the log's faster moves about its bias, raw unit; infinite in a log without moves."""
    moving = ~quiet & channels.is_valid
    gyro = channels.is_gyroscope
    if not moving.any() or not quiet.any() or not gyro.any():
        return float("inf")
    bias = medians(channels.mean[quiet][:, gyro])
    return float(quantiles(np.abs(channels.mean[moving][:, gyro] - bias), [0.9]).max())


def join_quiet(channels: Channels, quiet: BoolArray, loose: BoolArray, noise: MeanNoise) -> list[Run]:
    """Stretches of one pose from quiet ones, however short: neighbours with only a bump between are one."""
    runs: list[Run] = []
    creeping = CREEP_PART * speed_of_moves(channels, quiet)
    for first, last in ranges_of(quiet):
        piece = Run(first, last)
        if runs:
            before = runs[-1]
            gap = (first - before.last) * channels.step_s
            if (gap <= BUMP_S or loose[before.last : first].all()) and _is_same_pose(
                channels, before, piece, noise, creeping
            ):
                runs[-1] = Run(before.first, last, (*before.bumps, (before.last, first)))
                continue
        runs.append(piece)
    return runs


def long_enough(channels: Channels, runs: list[Run], shortest_s: float) -> list[Run]:
    """Those whose quiet parts last as long."""
    shortest = channels.blocks(shortest_s)
    return [run for run in runs if sum(b - a for a, b in run.quiet_ranges()) >= shortest]


def set_down(channels: Channels, runs: list[Run], loose: BoolArray, taken: list[Run]) -> list[Run]:
    """Short stretches between moves on either side: poses of a second, not calm moments of a longer one or of a hand.

    ``loose`` (m,) as of :func:`loose_blocks`, ``taken`` what is a pose already.
    """
    most, found = channels.blocks(SET_DOWN_S), []
    usual = float(np.median([run.last - run.first for run in taken])) if taken else 0.0
    for run in long_enough(channels, runs, SEEN_S):
        if run.last - run.first < FAR_SHORTER * usual:
            continue
        first, last = grown(loose, (run.first, run.last))
        is_short = first > 0 and last < len(loose) and max(run.first - first, last - run.last) <= most
        if is_short and all(other.outer_last <= first or other.outer_first >= last for other in taken):
            found.append(run)
    return found


def _is_same_pose(channels: Channels, before: Run, after: Run, noise: MeanNoise, creeping: float) -> bool:
    difference = np.zeros(channels.mean.shape[1])
    variance = np.zeros_like(difference)
    for sign, run in ((-1.0, before), (1.0, after)):
        mean, blocks = run_mean(channels, run)
        difference += sign * mean
        variance += noise.variance(blocks * channels.step_s)
    variance += 2.0 * channels.quantisation_variance
    live = variance > 0.0
    statistic = float(np.sum(difference[live] ** 2 / variance[live]))
    if statistic > float(probability.chdtri(int(live.sum()), SAME_POSE)):
        return False
    return _comes_back(channels, before, after, noise, creeping)


def _comes_back(channels: Channels, before: Run, after: Run, noise: MeanNoise, creeping: float) -> bool:
    """The gyro's integral between two stretches is nothing: a push and its return, not a turn about the vertical."""
    gyro = np.flatnonzero(channels.is_gyroscope)
    between = slice(before.last, after.first)
    is_valid = channels.is_valid[between]
    if not len(gyro) or not is_valid.any():
        return True
    bias = 0.5 * (run_mean(channels, before)[0] + run_mean(channels, after)[0])[gyro]
    rate = channels.mean[between][is_valid][:, gyro] - bias
    net = rate.mean(axis=0)
    variance = noise.variance(len(rate) * channels.step_s)[gyro]
    live = variance > 0.0
    statistic = float(np.sum(net[live] ** 2 / variance[live]))
    is_nothing = statistic < float(probability.chdtri(max(int(live.sum()), 1), SAME_POSE))
    travelled = float(np.linalg.norm(rate, axis=1).mean())
    return is_nothing or float(np.linalg.norm(net)) < max(RETURN * travelled, creeping)


def run_mean(channels: Channels, run: Run) -> tuple[FloatArray, int]:
    """(c,) mean reading of the quiet blocks of a run, and how many they are."""
    blocks = run.quiet_rows(channels.mean)
    return blocks.mean(axis=0), len(blocks)


def means_of(values: FloatArray, parts: list[list[Range]]) -> FloatArray:
    """(h, c) means of one row a block ``values`` (m, c) over the ranges of each part (h,), missing ones passed over."""
    ranges = np.array([r for part in parts for r in part], dtype=np.int64).reshape(-1, 2)
    owner = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    return _core.column_means(values, ranges, owner, len(parts))


def find_unsteady(channels: Channels, loose: BoolArray, steady: list[Run], gravity: float | None) -> list[Run]:
    """Poses that never come down to the noise floor: long calm stretches whose attitude stays within a hand's sway.

    ``gravity`` is the accelerometer's reading of |g| in raw units; without it an angle has no scale, and none is found.
    """
    accelerometer = np.flatnonzero(~channels.is_gyroscope)
    if gravity is None or not len(accelerometer):
        return []
    free = loose.copy()
    for run in steady:
        # A calm fringe of a steady pose is its settling, not another pose.
        free[slice(*grown(free, (run.first, run.last)))] = False
    attitude = channels.mean[:, accelerometer] / gravity
    bias = (
        medians(np.vstack([channels.mean[a:b] for run in steady for a, b in run.quiet_ranges()])) if (steady) else None
    )
    shortest, bump = channels.blocks(MIN_POSE_S), channels.blocks(BUMP_S)
    found: list[Run] = []
    for first, last in ranges_of(free):
        run = Run(first, last, (), True)
        if last - first < shortest or _sway(attitude, [run]) > SWAY_RAD:
            continue
        if bias is not None and turns_on(channels, first, last, bias):
            continue
        if any(
            max(first - near.last, near.first - last) < bump and _sway(attitude, [near, run]) < SWAY_RAD
            for near in steady
        ):
            # The same pose before it settled, or after it was touched.
            continue
        if found and first - found[-1].last < bump and _sway(attitude, [found[-1], run]) < SWAY_RAD:
            before = found.pop()
            run = Run(before.first, last, (*before.bumps, (before.last, first)), True)
        found.append(run)
    return found


def without_approaches(channels: Channels, steady: list[Run]) -> list[Run]:
    """Poses without the last of a slow move before it is set down, or the first of one that is lifted: what still turns
    beside a longer pose is its fringe."""
    beside = channels.blocks(BUMP_S)
    kept = []
    for run in steady:
        longer = [
            near
            for near in steady
            if near.last - near.first > run.last - run.first
            and 0 <= max(run.first - near.last, near.first - run.last) < beside
        ]
        if not any(turns_on(channels, run.first, run.last, run_mean(channels, near)[0]) for near in longer):
            kept.append(run)
    return kept


def turns_on(channels: Channels, first: int, last: int, bias: FloatArray) -> bool:
    """The gyro's reading follows a straight line: a slow move, or its pause, turning back or on about another axis.

    A hand that tries to hold still goes to and fro.
    """
    gyro = channels.is_gyroscope
    is_valid = channels.is_valid[first:last]
    if not gyro.any() or np.count_nonzero(is_valid) < 2:
        return False
    rate = channels.mean[first:last][is_valid][:, gyro] - bias[gyro]
    t = np.flatnonzero(is_valid) - np.mean(np.flatnonzero(is_valid))
    along = np.sum(rate.mean(axis=0) ** 2) + np.sum((t @ rate) ** 2) / (np.sum(t**2) * len(t))
    return float(along) > ONE_WAY * float(np.mean(np.sum(rate**2, axis=1)))


def _sway(attitude: FloatArray, runs: list[Run]) -> float:
    """Scatter of the attitude over runs together [rad]."""
    blocks = np.vstack([attitude[a:b] for run in runs for a, b in run.quiet_ranges()])
    return float(np.linalg.norm(blocks.std(axis=0)))


@dataclass(frozen=True, eq=False)
class EdgeNoise:
    """What an end of a pose is compared by: the ``terms`` (3, c) of a mean's noise, its ``variance`` (k, c) over
    ``EDGE_BLOCKS``, and the ``limit`` of χ² of the channels that are ``live`` (c,)."""

    terms: FloatArray
    variance: FloatArray
    live: BoolArray
    limit: float

    @classmethod
    def of(cls, channels: Channels, noise: MeanNoise) -> EdgeNoise:
        """The same for all poses of a log."""
        live = np.asarray(noise.variance(1.0) > 0.0)
        duration_s = np.array(EDGE_BLOCKS, dtype=np.float64)[:, None] * channels.step_s
        limit = float(probability.chdtri(int(live.sum()), CLEAN_EDGE))
        return cls(np.array([noise.white, noise.flicker, noise.walk]), noise.variance(duration_s), live, limit)


def trim_edges(channels: Channels, run: Run, edges: EdgeNoise) -> Run:
    """Take blocks off both ends until no stretch at an end departs from the middle of the pose.

    Stretches of 1, 2, 4 ... blocks at each end are compared with the central half; at most a third is taken off.
    """
    n = run.last - run.first
    start, tail = _core.ends_to_trim(
        channels.mean[run.first : run.last],
        [(a - run.first, b - run.first) for a, b in run.bumps],
        edges.terms,
        channels.quantisation_variance,
        channels.step_s,
        edges.variance,
        edges.live,
        edges.limit,
    )
    stop = n - tail
    bumps = tuple((a, b) for a, b in run.bumps if b > run.first + start and a < run.first + stop)
    bumps = tuple((max(a, run.first + start), min(b, run.first + stop)) for a, b in bumps)
    return replace(run, first=run.first + start, last=run.first + stop, bumps=bumps, trimmed=(start, n - stop))
