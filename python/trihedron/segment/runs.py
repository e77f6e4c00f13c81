"""From quiet blocks to poses, in units of blocks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core, probability
from trihedron.arrays import BoolArray, FloatArray
from trihedron.quantiles import medians, quantile, quantiles
from trihedron.ranges import Range, grown, ranges_of
from trihedron.records.segments import LEAST_POSE_S
from trihedron.segment.channels import WINDOW_BLOCKS, Channels
from trihedron.segment.floor import Activity
from trihedron.segment.noise import MeanNoise

SEEN_S = 0.8
"""Part of the shortest pose that is seen at the noise floor: its ends share their blocks with the moves."""
SET_DOWN_S = 0.5
"""Longest approach to, and departure from, a short pose: a sensor that is set down takes less, a calming hand more."""
FAR_SHORTER = 0.1
"""Least length of a short pose over the usual one: among poses of half a minute, a second is a hesitation."""
BUMP_S = 2.0
"""Longest push with its ringing; a longer disturbance is a move even if the pose comes back."""
RETURN = 0.3
"""Net rotation over the path of a push and its return, below which they cancel."""
CLEAN_EDGE = 2e-3
"""Probability that an undisturbed edge is trimmed, which costs some tenths of a second."""
EDGE_BLOCKS = [2**k for k in range(16)]
"""Lengths of the edges of a pose that are compared with its middle, in blocks."""
CREEP_PART = 0.02
"""Rate of a settling support over that of the log's own moves, at most."""
SWAY_RAD = 0.02
"""About one degree, the tremor and sway of a hand that tries to hold still: the limit for an unsteady pose."""
ONE_WAY = 0.5
"""Share of a hand's mean square rate that a straight line in time explains, above which it is a rotation: over half in
a slow move and in its pauses, almost nothing in a tremor of several swings."""


@dataclass(frozen=True)
class Run:
    """Blocks ``[first, last)`` of one pose; ``bumps`` are block ranges of disturbances in it, which are excluded.

    Not ``is_still`` if it moves throughout: the rotation of the moves beside it begins and ends inside it.
    """

    first: int
    last: int
    bumps: tuple[Range, ...] = ()
    is_unsteady: bool = False
    trimmed: Range = (0, 0)
    is_still: bool = True

    @property
    def outer_first(self) -> int:
        """First block before the edges were trimmed."""
        return self.first - self.trimmed[0]

    @property
    def outer_last(self) -> int:
        """Block after the last one before the edges were trimmed."""
        return self.last + self.trimmed[1]

    def quiet_ranges(self) -> list[Range]:
        """The ranges between disturbances."""
        if not self.bumps:
            return [(self.first, self.last)] if self.last > self.first else []
        edges = [self.first, *(k for bump in self.bumps for k in bump), self.last]
        return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]

    def quiet_rows(self, values: FloatArray) -> FloatArray:
        """(k, c) of one row per block ``values`` (m, c): those between disturbances; a view where there are none."""
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


def whole_windows(quiet: BoolArray, is_valid: BoolArray) -> BoolArray:
    """The whole of the quiet windows: a quiet block is the centre of one, which extends further on either side.

    Gaps shorter than a window are closed: a true disturbance raises every window that contains it.
    """
    out = quiet.copy()
    for first, last in ranges_of(~quiet):
        if first > 0 and last < len(quiet) and last - first < WINDOW_BLOCKS and is_valid[first:last].all():
            out[first:last] = True
    kernel = np.ones(2 * (WINDOW_BLOCKS // 2) + 1)
    return (np.convolve(out.astype(np.float64), kernel, mode="same") > 0.5) & is_valid


def speed_of_moves(channels: Channels, quiet: BoolArray) -> float:
    """Gyro reading of the log's faster moves about its bias, raw unit; infinite in a log without moves."""
    moving = ~quiet & channels.is_valid
    gyro = channels.is_gyroscope
    if not moving.any() or not quiet.any() or not gyro.any():
        return float("inf")
    bias = medians(channels.mean[quiet][:, gyro])
    return float(quantiles(np.abs(channels.mean[moving][:, gyro] - bias), [0.9]).max())


def join_quiet(channels: Channels, quiet: BoolArray, loose: BoolArray, noise: MeanNoise) -> list[Run]:
    """Poses from quiet ranges of any length: neighbours with only a disturbance between them are one."""
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
    """Runs whose quiet parts together last at least ``shortest_s``."""
    shortest = channels.blocks(shortest_s)
    return [run for run in runs if sum(b - a for a, b in run.quiet_ranges()) >= shortest]


def set_down(channels: Channels, runs: list[Run], loose: BoolArray, taken: list[Run]) -> list[Run]:
    """Short poses between moves on either side, not calm moments of a longer pose or of a hand.

    ``loose`` (m,) as of :func:`loose_blocks`, ``taken`` the poses found so far.
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
    if statistic > float(probability.chdtri(int(live.sum()), probability.FALSE_ALARM)):
        return False
    return _comes_back(channels, before, after, noise, creeping)


def _comes_back(channels: Channels, before: Run, after: Run, noise: MeanNoise, creeping: float) -> bool:
    """Whether the gyro's integral between two ranges is zero: a push and its return, no rotation about the vertical."""
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
    is_nothing = statistic < float(probability.chdtri(max(int(live.sum()), 1), probability.FALSE_ALARM))
    travelled = float(np.linalg.norm(rate, axis=1).mean())
    return is_nothing or float(np.linalg.norm(net)) < max(RETURN * travelled, creeping)


def run_mean(channels: Channels, run: Run) -> tuple[FloatArray, int]:
    """(c,) mean reading of the quiet blocks of a run, and their number."""
    blocks = run.quiet_rows(channels.mean)
    return blocks.mean(axis=0), len(blocks)


def means_of(values: FloatArray, parts: list[list[Range]]) -> FloatArray:
    """(h, c) means of one row per block ``values`` (m, c) over the ranges of each part (h,), without missing ones."""
    ranges = np.array([r for part in parts for r in part], dtype=np.int64).reshape(-1, 2)
    owner = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    return _core.column_means(values, ranges, owner, len(parts))


def find_unsteady(channels: Channels, loose: BoolArray, steady: list[Run], gravity: float | None) -> list[Run]:
    """Poses that never reach the noise floor: long calm ranges whose attitude stays within a hand's sway.

    ``gravity`` is the accelerometer's reading of |g| in raw units; without it angles have no scale, and none is found.
    """
    accelerometer = np.flatnonzero(~channels.is_gyroscope)
    if gravity is None or not len(accelerometer):
        return []
    free = loose.copy()
    for run in steady:
        # Calm blocks beside a steady pose are its settling, not another pose.
        free[slice(*grown(free, (run.first, run.last)))] = False
    attitude = channels.mean[:, accelerometer] / gravity
    bias = medians(np.vstack([run.quiet_rows(channels.mean) for run in steady])) if steady else None
    shortest = channels.blocks(LEAST_POSE_S)
    found: list[Run] = []
    for first, last in ranges_of(free):
        run = Run(first, last, (), True)
        if last - first < shortest or _sway(attitude, [run]) > SWAY_RAD:
            continue
        if bias is not None and turns_on(channels, first, last, bias, steady):
            continue
        if any(is_one_pose(channels, attitude, run, near) for near in steady):
            # The same pose before it settled, or after it was disturbed.
            continue
        if found and is_one_pose(channels, attitude, run, found[-1]):
            before = found.pop()
            run = Run(before.first, last, (*before.bumps, (before.last, first)), True)
        found.append(run)
    return found


def without_approaches(channels: Channels, steady: list[Run]) -> list[Run]:
    """The runs without the end of a slow move before a pose, or the start of one after it: these rotate steadily beside
    a longer run."""
    beside = channels.blocks(BUMP_S)
    noise = _gyro_noise(channels, steady)

    def approaches(run: Run, near: Run) -> bool:
        gap = max(run.first - near.last, near.first - run.last)
        if near.last - near.first <= run.last - run.first or not 0 <= gap < beside:
            return False
        bias, n_bias = run_mean(channels, near)
        along, square, n = _line(channels, run.first, run.last, bias)
        # The bias has noise too, and every run of the log is tested.
        return along > max(ONE_WAY * square, _line_by_chance(noise, n, len(steady)) * (1.0 + n / n_bias))

    return [run for run in steady if not any(approaches(run, near) for near in steady)]


def turns_on(channels: Channels, first: int, last: int, bias: FloatArray, still: Sequence[Run] = ()) -> bool:
    """Whether the gyro's reading follows a straight line: a slow move, or its pause before the next move.

    A hand that tries to hold still moves to and fro, beyond the noise of the ``still`` runs if given.
    """
    along, square, n = _line(channels, first, last, bias)
    noise = _gyro_noise(channels, still)
    return along > max(ONE_WAY * (square - noise), _line_by_chance(noise, n))


def _line(channels: Channels, first: int, last: int, bias: FloatArray) -> tuple[float, float, int]:
    """Mean square of the gyro's rate in these blocks that a straight line in time explains, all of it, and the number
    of blocks; the line is 0 where they have none."""
    gyro = channels.is_gyroscope
    is_valid = channels.is_valid[first:last]
    n = int(np.count_nonzero(is_valid))
    if not gyro.any() or n < 2:
        return 0.0, 0.0, 1
    rate = channels.mean[first:last][is_valid][:, gyro] - bias[gyro]
    t = np.flatnonzero(is_valid) - np.mean(np.flatnonzero(is_valid))
    along = float(np.sum(rate.mean(axis=0) ** 2) + np.sum((t @ rate) ** 2) / (np.sum(t**2) * n))
    return along, float(np.mean(np.sum(rate**2, axis=1))), n


def _line_by_chance(noise: float, n: int, n_tests: int = 1) -> float:
    """What a line through ``n`` blocks explains of their ``noise`` (mean square, three axes) in a rare false alarm."""
    return float(probability.chdtri(6, probability.FALSE_ALARM / n_tests)) * noise / (3.0 * n)


def _gyro_noise(channels: Channels, still: Sequence[Run]) -> float:
    """Variance of the gyro's block means inside static runs, sum of its axes; 0 without a run."""
    parts = [run.quiet_rows(channels.mean)[:, channels.is_gyroscope] for run in still]
    return float(np.median([part.var(axis=0).sum() for part in parts])) if parts else 0.0


def is_one_pose(channels: Channels, attitude: FloatArray, run: Run, near: Run) -> bool:
    """Whether a run is the pose ``near`` before or after a disturbance: close in time, and within a hand's sway."""
    apart = max(run.first - near.last, near.first - run.last)
    return apart < channels.blocks(BUMP_S) and _sway(attitude, [near, run]) < SWAY_RAD


def _sway(attitude: FloatArray, runs: list[Run]) -> float:
    """Scatter of the attitude over all runs together [rad]."""
    blocks = np.vstack([run.quiet_rows(attitude) for run in runs])
    return float(np.linalg.norm(blocks.std(axis=0)))


@dataclass(frozen=True, eq=False)
class EdgeNoise:
    """Limits for the edges of a pose: the ``terms`` (3, c) of a mean's noise, its ``variance`` (k, c) over
    ``EDGE_BLOCKS``, and the ``limit`` of χ² for the ``live`` channels (c,)."""

    terms: FloatArray
    variance: FloatArray
    live: BoolArray
    limit: float

    @classmethod
    def of(cls, channels: Channels, noise: MeanNoise) -> EdgeNoise:
        """The limits for all poses of a log."""
        live = np.asarray(noise.variance(1.0) > 0.0)
        duration_s = np.array(EDGE_BLOCKS, dtype=np.float64)[:, None] * channels.step_s
        limit = float(probability.chdtri(int(live.sum()), CLEAN_EDGE))
        return cls(np.array([noise.white, noise.flicker, noise.walk]), noise.variance(duration_s), live, limit)


def trim_edges(channels: Channels, run: Run, edges: EdgeNoise) -> Run:
    """Remove blocks at both ends until no edge differs from the middle of the pose.

    Edges of 1, 2, 4 ... blocks at each end are compared with the central half; at most a third is removed.
    """
    n = run.last - run.first
    start, tail, is_still = _core.ends_to_trim(
        channels.mean[run.first : run.last], [(a - run.first, b - run.first) for a, b in run.bumps], edges.terms,
        channels.quantisation_variance, channels.step_s, edges.variance, edges.live, edges.limit,
    )  # fmt: skip
    stop = n - tail
    bumps = tuple((a, b) for a, b in run.bumps if b > run.first + start and a < run.first + stop)
    bumps = tuple((max(a, run.first + start), min(b, run.first + stop)) for a, b in bumps)
    trimmed = (start, n - stop)
    return replace(run, first=run.first + start, last=run.first + stop, bumps=bumps, trimmed=trimmed, is_still=is_still)
