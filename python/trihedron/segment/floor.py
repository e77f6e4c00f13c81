"""The sensor's own noise, from the log itself, and the two activities measured against it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron import probability
from trihedron.arrays import BoolArray, FloatArray
from trihedron.segment.channels import USUALLY_STILL, WINDOW_BLOCKS, Channels, rolling_mean
from trihedron.segment.range_ends import RangeEnd, inside_the_range

SEED_FRACTION = 0.02
SEED_S = 1.0
"""The quietest 2 % of a log, and no less than one second of it, is taken for still to begin with."""
ROUNDING = 1e-7
"""Of a channel's rms: running sums round at a tenth of this; no sensor's noise is so small beside its motion."""
FALSE_ALARM = 1e-4
"""Chance that a still window is called moving: once in minutes of windows, and so short a gap is closed again."""
_MAX_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class Activity:
    """How much every block moves, as logarithms of power over the sensor's own noise.

    ``fast`` (m,) is the scatter inside blocks, ``slow`` (m,) the scatter of block means, both over the window round the
    block and averaged over channels (log of a ratio: 0 is still). ``is_quiet`` (m,) is at the noise floor in both.
    ``fast_limit``, ``slow_limit`` are the limits of a still sensor; ``white_variance`` and ``slow_variance`` (c,) the
    floors themselves: variance of a reading inside a block, and of a block mean inside a window [raw unit squared].
    """

    fast: FloatArray
    slow: FloatArray
    fast_limit: float
    slow_limit: float
    is_quiet: BoolArray
    white_variance: FloatArray
    slow_variance: FloatArray

    def is_wandering(self, channels: Channels) -> bool:
        """The floor itself moves: block means scatter as those of a random walk do, or more.

        For white noise the variance of block means is that of a reading over the block's length n; for a random walk
        it is 5n times that (for a ramp 30n). A sensor at rest is near the first, a body in motion near the last; half
        of the walk's is the limit, for the median channel.
        """
        live = (self.white_variance > 0.0) & (self.slow_variance > 0.0)
        if not live.any():
            return False
        ratio = channels.length * self.slow_variance[live] / self.white_variance[live]
        return bool(np.median(ratio) > 0.5 * WINDOW_BLOCKS * channels.length)


def measure_activity(channels: Channels, ends: Sequence[RangeEnd] = ()) -> Activity:
    """Noise floor by growing the quietest windows until they hold every window that the same noise explains.

    The floor of a channel is the median over the quiet windows, so neither axes of different noise nor a few
    disturbed windows matter; the limit lies at the false-alarm quantile of a log-normal whose width is that of the
    chi-square law, or the width of the quiet windows' lower half where that is larger (coloured noise, rounding).
    A channel at one of the ``ends`` of its range has no vote there.
    """
    width = min(WINDOW_BLOCKS, channels.n_blocks)
    n_channels = channels.mean.shape[1]
    rounding = channels.quantisation_variance
    centre = np.nanmean(channels.mean[channels.is_valid], axis=0)
    mean = np.where(channels.is_valid[:, None], channels.mean - centre, 0.0)
    whole = rolling_mean((~channels.is_valid)[:, None].astype(np.float64), width)[:, 0] == 0.0
    inside, between = _scatter(channels, mean, channels.variance)
    inside = np.maximum(inside, rounding)
    between = np.maximum(between, rounding / channels.length)
    alive = (np.median(inside[whole], axis=0) > 0.0) & (np.median(between[whole], axis=0) > 0.0)
    if not alive.any():
        nothing = np.zeros(channels.n_blocks)
        return Activity(nothing, nothing, 0.0, 0.0, whole, rounding, rounding / channels.length)
    # Running sums round at 1e-8 of the signal: a simulation without noise must not take that for its noise.
    tiny = np.maximum(1e-12 * np.median(inside[whole], axis=0), ROUNDING**2 * np.mean(mean**2, axis=0))[alive]
    inside_alive, between_alive = inside[:, alive] + tiny, between[:, alive] + tiny / channels.length
    tells = inside_the_range(channels, ends)[:, alive]
    total = _mean_of(
        np.log(inside_alive + between_alive) - _usual(inside_alive + between_alive, tells & whole[:, None]), tells
    )
    total[~whole] = np.inf
    n_seed = min(max(int(SEED_FRACTION * whole.sum()), channels.blocks(SEED_S)), int(whole.sum()))
    quiet = total <= np.partition(total, n_seed - 1)[n_seed - 1]
    n_alive = int(alive.sum())
    freedom = (width * (channels.length - 1) * n_alive, max(width - 1, 1) * n_alive)
    fast = slow = total
    limits = [0.0, 0.0]
    for _ in range(_MAX_ROUNDS):
        inside_floor, between_floor = (_median_of(a, tells, quiet) for a in (inside_alive, between_alive))
        fast = np.log(_mean_of(inside_alive / inside_floor, tells))
        slow = np.log(_mean_of(between_alive / between_floor, tells))
        limits = [_limit(a[quiet], nu) for a, nu in zip((fast, slow), freedom, strict=True)]
        grown = whole & (fast <= limits[0]) & (slow <= limits[1])
        if not grown.any() or np.array_equal(grown, quiet):
            break
        quiet = grown
    white, wander = np.maximum(rounding, 0.0), rounding / channels.length
    white = white.copy()
    white[alive] = _median_of(inside_alive, tells, quiet)
    wander[alive] = _median_of(between_alive, tells, quiet) / _chi2_median_ratio(max(width - 1, 1))
    return Activity(fast, slow, limits[0], limits[1], quiet, white, wander + np.zeros(n_channels))


def quiet_channels(channels: Channels, activity: Activity, which: BoolArray) -> BoolArray:
    """(m,) windows in which the channels ``which`` (c,) alone are at the noise floor, whatever the others read."""
    width = min(WINDOW_BLOCKS, channels.n_blocks)
    alive = which & (activity.white_variance > 0.0) & (activity.slow_variance > 0.0)
    if not alive.any() or not activity.is_quiet.any():
        return activity.is_quiet.copy()
    is_valid = channels.is_valid[:, None]
    usual = np.mean(channels.mean[activity.is_quiet][:, alive], axis=0)
    levels = _scatter(channels, np.where(is_valid, channels.mean[:, alive] - usual, 0.0), channels.variance[:, alive])
    out: BoolArray = rolling_mean((~is_valid).astype(np.float64), width)[:, 0] == 0.0
    n = int(alive.sum())
    freedoms = (width * (channels.length - 1) * n, max(width - 1, 1) * n)
    floors = (activity.white_variance, activity.slow_variance)
    for level, floor, freedom in zip(levels, floors, freedoms, strict=True):
        ratio = np.log(np.maximum((level / floor[alive]).mean(axis=1), ROUNDING))
        out = np.asarray(out & (ratio <= _limit(ratio[activity.is_quiet], freedom)))
    return out


def _scatter(channels: Channels, mean: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Variance inside the blocks and of block means about their own, over windows (m, c).

    ``mean`` (m, c) are counted from near their own, for running sums round, and nothing where blocks are invalid.
    """
    width = min(WINDOW_BLOCKS, channels.n_blocks)
    inside = rolling_mean(np.where(channels.is_valid[:, None], variance, 0.0), width)
    between = (rolling_mean(mean**2, width) - rolling_mean(mean, width) ** 2) * (width / max(width - 1, 1))
    return inside, between


def _usual(power: FloatArray, tells: BoolArray) -> FloatArray:
    """(c,) logarithm of a channel's power when still, roughly: channels of different units are then averaged alike."""
    return np.log([np.quantile(power[mask, c], USUALLY_STILL) for c, mask in enumerate(tells.T)])


def _mean_of(values: FloatArray, tells: BoolArray) -> FloatArray:
    """(m,) mean over the channels that tell; infinite where none does."""
    if tells.all():
        mean: FloatArray = values.mean(axis=1)
        return mean
    count = tells.sum(axis=1)
    return np.where(count > 0, np.where(tells, values, 0.0).sum(axis=1) / np.maximum(count, 1), np.inf)


def _median_of(values: FloatArray, tells: BoolArray, quiet: BoolArray) -> FloatArray:
    """(c,) median over quiet windows in which a channel tells; over all in which it does where no quiet one is."""
    if tells.all():
        median: FloatArray = np.median(values[quiet], axis=0)
        return median
    chosen = [quiet & one if (quiet & one).any() else one for one in tells.T]
    return np.array([np.median(values[mask, c]) for c, mask in enumerate(chosen)])


def _limit(activity: FloatArray, freedom: int) -> float:
    median = float(np.median(activity))
    lower = median - float(np.quantile(activity, probability.ndtr(-1.0)))
    return median + -float(probability.ndtri(FALSE_ALARM)) * max(lower, float(np.sqrt(2.0 / freedom)))


def _chi2_median_ratio(freedom: int) -> float:
    return float(probability.chdtri(freedom, 0.5) / freedom)
