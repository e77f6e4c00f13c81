"""The sensor's own noise, estimated from the log, and the two activities relative to it.

At a range limit a static channel reads one code for seconds, which is no measure of its noise.
"""

from dataclasses import dataclass

import numpy as np

from trihedron import _core, probability
from trihedron.arrays import BoolArray, FloatArray
from trihedron.quantiles import median
from trihedron.ranges import Range
from trihedron.segment.channels import WINDOW_BLOCKS, Channels, rolling_mean

SELDOM = 0.1
"""Share of a log inside the range below which a channel's quiet windows cannot be separated from the others."""
CUT = 0.01
"""Share of a pose's readings at the range limit above which its mean is clipped: below it the mean errs by less than
0.4 % of a reading's noise, a tenth of the error of a mean of 700 readings."""


def inside_the_range(channels: Channels) -> BoolArray:
    """(m, c) windows in which a channel's scatter is the sensor's own: none of its readings is at a range limit.

    A pose beyond the range gives one code for seconds, the quietest part of the log by far; with that as its noise
    floor, every pose inside the range would seem to vibrate.
    """
    near = (channels.at_limit > 0.0).astype(np.float64)
    inside: BoolArray = rolling_mean(near, min(WINDOW_BLOCKS, channels.n_blocks)) == 0.0
    # A channel that is hardly ever inside has no other windows.
    inside[:, inside.mean(axis=0) < SELDOM] = True
    return inside


def clipped_channel(channels: Channels, blocks: Range) -> int | None:
    """The channel of a static interval that is at its range limit, or ``None``: it only gives a bound of gravity."""
    share = channels.at_limit[slice(*blocks)].mean(axis=0)
    return int(np.argmax(share)) if share.max() > CUT else None


SEED_S = 1.0
"""The quietest 2 % of a log, and at least one second of it, count as still at first."""
ROUNDING = 1e-7
"""Least noise over a channel's rms: running sums round at a tenth of this; no sensor's noise is so small."""
TAILS = (probability.ndtr(-1.0), -probability.ndtri(probability.RARE_ALARM))
"""Share of still windows below one deviation under their median, and deviations above it up to which they are still."""


@dataclass(frozen=True, eq=False)
class Activity:
    """Activity of every block, as logarithms of power over the sensor's own noise.

    ``fast`` (m,) is the scatter inside blocks, ``slow`` (m,) the scatter of block means, both over the window around
    the block and averaged over channels (log of a ratio: 0 is still). ``is_quiet`` (m,) is at the noise floor in both.
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

    def is_drifting(self, channels: Channels) -> bool:
        """Whether the quiet windows move: block means scatter like those of a random walk, or more.

        For white noise the variance of block means is that of a reading over the block's length n; for a random walk
        it is 5n times that (for a ramp 30n). A static sensor is near the first, a moving one near the last; half of the
        walk's value is the limit, for the median channel.
        """
        live = (self.white_variance > 0.0) & (self.slow_variance > 0.0)
        if not live.any():
            return False
        ratio = channels.length * self.slow_variance[live] / self.white_variance[live]
        return median(ratio) > 0.5 * WINDOW_BLOCKS * channels.length


def measure_activity(channels: Channels) -> Activity:
    """Noise floor, by growing the quietest windows until they include every window that the same noise explains.

    The floor of a channel is the median over the quiet windows, which is robust against axes of different noise and a
    few disturbed windows; the limit is the false-alarm quantile of a log-normal with the width of the chi-square
    distribution, or of the quiet windows' lower half where that is larger (coloured noise, rounding).
    Windows of a channel at its range limit are excluded.
    """
    width = min(WINDOW_BLOCKS, channels.n_blocks)
    freedom = max(width - 1, 1)
    fast, slow, limits, is_quiet, white, drift = _core.noise_floor(
        channels.mean, channels.variance, channels.is_valid, inside_the_range(channels),
        channels.quantisation_variance, channels.length,
        (width, channels.blocks(SEED_S), probability.chdtri(freedom, 0.5) / freedom), TAILS,
    )  # fmt: skip
    return Activity(fast, slow, limits[0], limits[1], is_quiet, white, drift)


def quiet_channels(channels: Channels, activity: Activity, which: BoolArray) -> BoolArray:
    """(m,) windows in which the channels ``which`` (c,) are at the noise floor, whatever the others read."""
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
        out = np.asarray(out & (ratio <= _core.still_limit(ratio[activity.is_quiet], freedom, TAILS)))
    return out


def _scatter(channels: Channels, mean: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Variance inside the blocks and of block means, over windows (m, c).

    ``mean`` (m, c) are relative to a constant near them, because running sums round, and 0 where blocks are invalid.
    """
    width = min(WINDOW_BLOCKS, channels.n_blocks)
    inside = rolling_mean(np.where(channels.is_valid[:, None], variance, 0.0), width)
    between = (rolling_mean(mean**2, width) - rolling_mean(mean, width) ** 2) * (width / max(width - 1, 1))
    return inside, between
