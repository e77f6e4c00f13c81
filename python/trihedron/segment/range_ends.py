"""Ends of a channel's range that a sensor rests at: one code for seconds, which is neither stillness nor a reading."""

from __future__ import annotations

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
"""Standard deviations of the noise from the end within which readings are cut, and look quieter than they are."""
SELDOM = 0.1
"""Share of a log inside the range below which a channel's quiet windows are not told from its loud ones."""
TELLS_CODES_APART = 0.6
"""Noise over step from which a reading never keeps one code by itself: half a second of it has at least two codes with
all but one chance in a billion."""
CUT = 0.01
"""Share of a pose's readings at the range limit from which its mean is that of a cut distribution: by less than
0.4 % of a reading's noise below it, a tenth of the error of a mean of 700 readings."""


@dataclass(frozen=True)
class RangeEnd:
    """The outermost reading of channel ``channel`` on the side ``side`` (1 or -1).

    ``margin`` is how near to it readings are cut (raw units); ``is_certain`` where noise would have told codes apart.
    """

    channel: int
    side: int
    reading: float
    margin: float
    is_certain: bool


def range_ends(channels: Channels, limits: Sequence[tuple[int, Limit]]) -> tuple[RangeEnd, ...]:
    """The ends among the (channel, limit) of all readings that poses may stand at.

    A stream has no limits: its readings are not all seen at once (:mod:`trihedron.channel_facts.limits`).
    """
    out: list[RangeEnd] = []
    for c, limit in limits:
        noise = 0.0 if channels.is_gyroscope[c] else _usual_noise(channels, c)
        # A gyro at rest is at no range limit, and a channel without noise has no tail to be cut.
        if noise > 0.0:
            step, rounding = float(channels.quantum[c]), float(channels.quantisation_variance[c])
            margin = max(NEAR * float(np.sqrt(noise)), step)
            is_certain = noise - rounding > (TELLS_CODES_APART * step) ** 2
            out.append(RangeEnd(c, 1 if limit.is_high else -1, limit.value, margin, is_certain))
    return tuple(out)


def _usual_noise(channels: Channels, channel: int) -> float:
    """Variance of a reading in calm windows of a channel that show more than its rounding; 0 where none does."""
    variance = np.where(channels.is_valid, channels.variance[:, channel], 0.0)[:, None]
    power = rolling_mean(variance, min(WINDOW_BLOCKS, channels.n_blocks))[:, 0]
    live = power[channels.is_valid & (power > 2.0 * channels.quantisation_variance[channel])]
    return quantile(live, USUALLY_STILL) if len(live) else 0.0


def inside_the_range(channels: Channels, ends: Sequence[RangeEnd]) -> BoolArray:
    """(m, c) windows in which a channel's scatter is the sensor's own.

    A pose whose reading lies beyond the range gives one code for seconds, the quietest stretch of the log by far; taken
    for its noise, every pose inside the range would seem to shake.
    """
    inside = np.ones(channels.mean.shape, dtype=np.bool_)
    for end in ends:
        reading = np.where(channels.is_valid, end.side * channels.mean[:, end.channel], -np.inf)
        near = (reading >= end.side * end.reading - end.margin)[:, None].astype(np.float64)
        inside[:, end.channel] &= rolling_mean(near, min(WINDOW_BLOCKS, channels.n_blocks))[:, 0] == 0.0
    # Of a channel that is hardly ever inside nothing else is known.
    inside[:, inside.mean(axis=0) < SELDOM] = True
    return inside


def is_cut(recording: Recording, channels: Channels, blocks: Range, ends: Sequence[RangeEnd]) -> RangeEnd | None:
    """The end of the accelerometer's range that a stretch of stillness stands at: of gravity it tells only a bound."""
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
