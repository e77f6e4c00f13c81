"""Range limits at which a static channel reads one code for seconds, which is no measure of its noise."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import BoolArray
from trihedron.quantiles import quantile
from trihedron.ranges import Range
from trihedron.records import Recording
from trihedron.records.channel_facts import Limit
from trihedron.segment.channels import USUALLY_STILL, WINDOW_BLOCKS, Channels, rolling_mean

NEAR = 4.0
"""Standard deviations of the noise from a limit within which readings are clipped, and look quieter than they are."""
SELDOM = 0.1
"""Share of a log inside the range below which a channel's quiet windows cannot be separated from the others."""
TELLS_CODES_APART = 0.6
"""Noise over LSB from which a reading never keeps one code by chance: half a second of it has at least two codes with a
probability of all but one in a billion."""
CUT = 0.01
"""Share of a pose's readings at the range limit above which its mean is clipped: below it the mean errs by less than
0.4 % of a reading's noise, a tenth of the error of a mean of 700 readings."""


@dataclass(frozen=True)
class RangeEnd:
    """The outermost reading of channel ``channel`` on the side ``side`` (1 or -1).

    ``margin`` is where readings are clipped (raw units); ``is_certain`` where noise never keeps one code.
    """

    channel: int
    side: int
    reading: float
    margin: float
    is_certain: bool


def range_ends(channels: Channels, limits: Sequence[tuple[int, Limit]]) -> tuple[RangeEnd, ...]:
    """The range limits, of all (channel, limit), that poses may be at.

    A stream has no limits: its readings are not all seen at once (:mod:`trihedron.channel_facts.limits`).
    """
    out: list[RangeEnd] = []
    for c, limit in limits:
        noise = 0.0 if channels.is_gyroscope[c] else _usual_noise(channels, c)
        # A static gyro is at no range limit, and a channel without noise has no tail to be clipped.
        if noise > 0.0:
            step, rounding = float(channels.quantum[c]), float(channels.quantisation_variance[c])
            margin = max(NEAR * float(np.sqrt(noise)), step)
            is_certain = noise - rounding > (TELLS_CODES_APART * step) ** 2
            out.append(RangeEnd(c, 1 if limit.is_high else -1, limit.value, margin, is_certain))
    return tuple(out)


def _usual_noise(channels: Channels, channel: int) -> float:
    """Variance of a reading in calm windows of a channel that exceeds rounding; 0 where none does."""
    variance = np.where(channels.is_valid, channels.variance[:, channel], 0.0)[:, None]
    power = rolling_mean(variance, min(WINDOW_BLOCKS, channels.n_blocks))[:, 0]
    live = power[channels.is_valid & (power > 2.0 * channels.quantisation_variance[channel])]
    return quantile(live, USUALLY_STILL) if len(live) else 0.0


def inside_the_range(channels: Channels, ends: Sequence[RangeEnd]) -> BoolArray:
    """(m, c) windows in which a channel's scatter is the sensor's own.

    A pose beyond the range gives one code for seconds, the quietest part of the log by far; with that as its noise
    floor, every pose inside the range would seem to vibrate.
    """
    inside = np.ones(channels.mean.shape, dtype=np.bool_)
    for end in ends:
        reading = np.where(channels.is_valid, end.side * channels.mean[:, end.channel], -np.inf)
        near = (reading >= end.side * end.reading - end.margin)[:, None].astype(np.float64)
        inside[:, end.channel] &= rolling_mean(near, min(WINDOW_BLOCKS, channels.n_blocks))[:, 0] == 0.0
    # A channel that is hardly ever inside has no other windows.
    inside[:, inside.mean(axis=0) < SELDOM] = True
    return inside


def is_cut(recording: Recording, channels: Channels, blocks: Range, ends: Sequence[RangeEnd]) -> RangeEnd | None:
    """The accelerometer's range limit that a static interval is at, or ``None``: it only gives a bound of gravity."""
    if recording.accelerometer is None:
        return None
    rows = recording.accelerometer[blocks[0] * channels.length : blocks[1] * channels.length]
    for end in ends:
        if not end.is_certain or channels.is_gyroscope[end.channel]:
            continue
        at_end = end.side * (rows[:, end.channel] - end.reading) >= -0.5 * channels.quantum[end.channel]
        if float(np.mean(at_end)) > CUT:
            return end
    return None
