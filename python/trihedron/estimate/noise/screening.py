"""Detection of steps, impacts and shaking in a static log, and of resolution and saturation of its readings.

Every detector measures the log's own scatter robustly; its threshold is the value that Gaussian noise of any spectrum
exceeds once in 10 000 logs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from trihedron import _core
from trihedron.arrays import TINY, BoolArray, FloatArray, IntArray
from trihedron.channel_facts.limits import share_at_limits
from trihedron.channel_facts.static_axes import adc_step
from trihedron.estimate.noise.gaps import bridged
from trihedron.probability import RARE_ALARM
from trihedron.quantiles import MAD_TO_SIGMA
from trihedron.ranges import edges_of, merged
from trihedron.records.segments import LEAST_SHARE, SAME_POSE_RAD
from trihedron.transforms import directions_of

READOUT_SAMPLE = 200_000
"""Readings from which resolution, noise and saturation are measured."""
MOST_EVENTS = 500
"""Most events of one axis that are examined, the strongest first."""
STEP_REACHES = (4, 16, 64)
"""Multiples of its own width over which a step must keep its level on either side."""
FEW, CLOSELY = 2, 0.7
"""Most events that are accepted without the test for tails, and the fraction of the limit that is close to it."""
TURN_RAD = 0.002
"""Turn of gravity from one mean to the next that motion makes: noise of 1 mg/√Hz, more than any part has, averaged
over a second turns it by as much, a bias that drifts by 0.1 g in a log by a third of it."""
LONGEST_EVENT = 64
"""Lengths of the longest event in a log: what lasts longer is a state of it."""
SAME_SHAPE = 1.3
"""Largest ratio of the ratios of second to first differences of two noises of one spectrum."""
MEANS_S, MEANS, FEWEST_MEANS = 1.0, 160, 16
"""Least length [s], most and least number of the means between which gravity turns."""


@dataclass(frozen=True)
class Event:
    """Event at readings ``[start, stop)``: ``size`` in their unit (shaking: ratio of scatter)."""

    start: int
    stop: int
    size: float

    @property
    def middle(self) -> float:
        """Its middle."""
        return 0.5 * (self.start + self.stop)

    def overlaps(self, others: Sequence[Event]) -> bool:
        """Whether it has readings in common with one of the ``others``."""
        return any(one.start < self.stop and self.start < one.stop for one in others)


def steps_and_impacts(x: FloatArray) -> tuple[list[Event], list[Event]]:
    """Steps of the level, and short excursions (impacts), of one channel ``x`` (n,); NaN marks a missing reading.

    Means of neighbouring clusters are differenced at every power of two; the differences of stationary or random-walk
    noise are Gaussian for any spectrum, so that one far outside their spread is an event.
    """
    n = len(x)
    scales = []
    size = 1
    while n // size >= LONGEST_EVENT:
        stride = max(1, size // 4)
        scales.append((size, stride, _limit((n - 2 * size) // stride + 1, n / size)))
        size *= 2
    found = _core.find_jumps(x, scales) if scales else []
    found = sorted(found, reverse=True)[:MOST_EVENTS]
    steps: list[Event] = []
    impacts: list[Event] = []
    taken: list[tuple[int, int]] = []
    for _, at, width, jump in found:
        if any(a - 2 * width <= at <= b + 2 * width for a, b in taken):
            continue
        reach = 4 * width
        levels = [_level_change(x, at, width, times * width) for times in STEP_REACHES if times * width < n // 4]
        slack = max(width // 4, 2)
        # A step keeps at least half of its jump over all reaches; a impact returns.
        if at + reach < n and at > reach and all(change / jump > 0.5 for change in levels):
            steps.append(Event(max(0, at - slack), min(n, at + slack), levels[0]))
            taken.append((at - 2 * width, at + 2 * width))
        else:
            start, stop = max(0, at - width - slack), min(n, at + 2 * width + slack)
            impacts.append(Event(start, stop, jump))
            taken.append((start, stop))
    return sorted(steps, key=lambda e: e.start), sorted(impacts, key=lambda e: e.start)


def with_tails(rest: FloatArray, impacts: list[Event]) -> list[Event]:
    """The ``impacts`` and what rings beside them, which they hide, up to the longest event: of a channel without the
    impacts, ``rest`` (n,), in which these are marked too."""
    impacts = list(impacts)
    while impacts:
        found = steps_and_impacts(bridged(rest))[1]
        spans = merged((e.start, e.stop) for e in (*impacts, *found))
        short = [(a, b) for a, b in spans if b - a <= len(rest) // LONGEST_EVENT]
        found = [e for e in found if e.overlaps(impacts) and any(a <= e.start < b for a, b in short)]
        # The line that bridges an impact may look like one.
        found = [e for e in found if np.isfinite(rest[e.start : e.stop]).any()]
        if not found:
            break
        for one in found:
            rest[one.start : one.stop] = np.nan
        impacts += found
    return impacts


def _level_change(x: FloatArray, at: int, width: int, reach: int) -> float:
    """Mean of the ``reach`` readings after the jump at ``at``, of width ``width``, less that of those before."""
    before = _mean(x[max(0, at - reach) : max(1, at - width // 4)])
    after = _mean(x[min(len(x) - 1, at + width + width // 4) : min(len(x), at + reach + width)])
    return after - before


def shaken(x: FloatArray, rate_hz: float) -> tuple[list[Event], bool]:
    """Stretches in which the scatter from reading to reading is far above that of the rest of the log; and whether they
    are no motion but noise with a second level: longer together than any event that is looked for, equally loud, and
    with the spectrum of the other readings. A hand or a support that vibrates is never twice as loud."""
    size = int(max(16, min(rate_hz, len(x) // 64)))
    n = len(x) // size
    if n < 32:
        return [], False
    level = np.log(_core.block_scatter(x, size) + TINY)
    centre = np.nanmedian(level)
    # With counts that rarely change the spread may be underestimated: at least that of chi-square is used.
    spread = max(MAD_TO_SIGMA * float(np.nanmedian(np.abs(level - centre))), math.sqrt(2.0 / size))
    distance, limit = (level - centre) / spread, _limit(n, n)
    hit = (distance > limit) & (level - centre > math.log(1.5))
    # As many close below the limit as above it are the tail of one distribution, as in `find_jumps`: no events.
    if FEW < np.count_nonzero(hit) < np.count_nonzero((distance > CLOSELY * limit) & (distance <= limit)):
        return [], False
    # A stretch begins before the second that is loud as a whole.
    stretches = merged((max(i - 1, 0), i + 1) for i in np.flatnonzero(hit).tolist())
    events = [Event(a * size, b * size, math.exp(0.5 * float(np.nanmax(level[a:b]) - centre))) for a, b in stretches]
    loud = level[hit]
    if len(loud) * LONGEST_EVENT < n:
        return events, False
    # Of squared differences of white noise each has 2/3 of a degree of freedom.
    scatter = MAD_TO_SIGMA * float(np.median(np.abs(loud - np.median(loud))))
    is_level = scatter < 2.0 * math.sqrt(3.0 / size) and _have_one_spectrum(x, np.repeat(hit, size))
    return events, is_level


def _have_one_spectrum(x: FloatArray, mask: BoolArray) -> bool:
    """Whether readings ``x`` (n,) inside and outside of a ``mask`` of the first of them differ in level alone.

    A hand or a support that vibrates has most of its power in the first differences.
    """
    ratio = []
    for part in (mask, ~mask):
        readings = np.where(part, x[: len(mask)], np.nan)
        first, second = (float(np.nanmean(np.diff(readings, order) ** 2)) for order in (1, 2))
        ratio.append(second / first)
    return 1.0 / SAME_SHAPE < ratio[0] / ratio[1] < SAME_SHAPE


def turn_of_gravity(x: FloatArray, rate_hz: float) -> tuple[float, float] | None:
    """Turn [rad] of gravity between neighbouring means of an accelerometer ``x`` (n, 3), the median, and their length
    [s], where it is motion; ``None`` where noise explains it.

    Scatter at one level throughout is no event, but a sensor that is carried turns. White noise would halve the turn
    between means four times as long, motion would not.
    """
    size = _mean_size(x, rate_hz)
    if len(x) // size < FEWEST_MEANS:
        return None
    turn, shorter = _turn(x, size), _turn(x, max(size // 4, 1))
    return (turn, size / rate_hz) if turn > max(TURN_RAD, math.sqrt(0.5) * shorter) else None


def other_orientation(x: FloatArray, rate_hz: float) -> tuple[float, int, int] | None:
    """Angle [rad] between gravity in most of an accelerometer's readings ``x`` (n, 3) and in the others, and the
    longest stretch ``[start, stop)`` of the former; ``None`` for a log of one orientation."""
    size = _mean_size(x, rate_hz)
    up, at = _directions(x, size)
    if len(up) < FEWEST_MEANS:
        return None
    near = up @ up.T > math.cos(SAME_POSE_RAD)
    most = near[near.sum(axis=1).argmax()]
    if np.count_nonzero(~most) < max(LEAST_SHARE * len(up), 2.0):
        return None
    centre = up[most].mean(axis=0)
    cosine = float(np.median(up[~most] @ centre)) / float(np.linalg.norm(centre))
    first, last = max(edges_of(most).tolist(), key=lambda run: run[1] - run[0])
    # The turn may reach into the first and last means of the stretch.
    start, stop = (0 if first == 0 else at[first + 1] * size), (len(x) if last == len(up) else at[last - 1] * size)
    return math.acos(min(max(cosine, -1.0), 1.0)), int(start), int(stop)


def _mean_size(x: FloatArray, rate_hz: float) -> int:
    return max(math.ceil(rate_hz * MEANS_S), len(x) // MEANS)


def _directions(x: FloatArray, size: int) -> tuple[FloatArray, IntArray]:
    """Directions of means of ``size`` rows, and the number of each."""
    mean, _, count = _core.block_statistics(x, size)
    held = np.flatnonzero(count > 0)
    return directions_of(mean[held]), held


def _turn(x: FloatArray, size: int) -> float:
    """Median angle between the directions of neighbouring means of ``size`` rows."""
    return float(np.median(np.linalg.norm(np.diff(_directions(x, size)[0], axis=0), axis=1)))


def _mean(values: FloatArray) -> float:
    present = values[np.isfinite(values)]
    return float(present.mean()) if len(present) else math.nan


def _limit(n_looks: int, n_independent: float) -> float:
    gaussian = math.sqrt(float(chdtri(1.0, RARE_ALARM / n_looks)))
    # The robust spread of k values has the relative standard error 1.17/√(2k): three of these are added.
    return gaussian * (1.0 + 3.0 * 1.17 / math.sqrt(2.0 * n_independent))


@dataclass(frozen=True)
class Readout:
    """Properties of the readings: ``resolution`` (LSB), ``sigma`` noise of one reading, shares of readings that repeat
    the one before, and of readings at a range limit."""

    resolution: float
    sigma: float
    repeated: float
    clipped: float

    @property
    def is_dead(self) -> bool:
        """Whether the noise is below half an LSB, too small to dither the readings."""
        return self.resolution > 0.0 and self.sigma < 0.5 * self.resolution


def readout(x: FloatArray) -> Readout:
    """Resolution, noise and saturation of one channel."""
    # Evenly spread pieces represent a long log.
    pieces = 1 if len(x) <= READOUT_SAMPLE else 16
    length = len(x) // pieces if pieces == 1 else READOUT_SAMPLE // pieces
    starts = np.linspace(0, len(x) - length, pieces).astype(int)
    parts = [part[np.isfinite(part)] for part in (x[s : s + length] for s in starts)]
    values = np.concatenate(parts)
    if len(values) < 2:
        return Readout(0.0, 0.0, 0.0, 0.0)
    change = np.abs(np.concatenate([np.diff(part) for part in parts]))
    resolution = adc_step(values)
    sigma = float(np.sqrt(0.5 * np.mean(np.square(change))))
    clipped = share_at_limits(values, sigma, resolution)
    return Readout(resolution, sigma, float(np.mean(change == 0.0)), clipped)


def tail_error(x: FloatArray) -> float:
    """Relative standard error of the white noise density of readings ``x`` (n,) due to their excess kurtosis.

    The variance of n independent readings with excess kurtosis κ has the relative variance (2 + κ)/n, of which the
    spectral likelihood includes 2/n; κ is twice that of differences of neighbours, which slow noise does not affect.
    """
    change = np.diff(x)
    change = change[np.isfinite(change)]
    square = np.square(change)
    mean = float(square.mean()) if len(change) else 0.0
    if mean == 0.0:
        return 0.0
    excess = 2.0 * (float(square @ square) / len(change) / mean**2 - 3.0)
    return 0.5 * math.sqrt(max(excess, 0.0) / len(change))


def repeated_rows(x: FloatArray) -> float:
    """Share of rows ``x`` (n, channels) that repeat the row before in all channels together, beyond chance."""
    sample = x[:200_000]
    if x.shape[1] < 2 or len(sample) < 2:
        return 0.0
    same = np.diff(sample, axis=0) == 0.0
    both = float(np.mean(np.all(same, axis=1)))
    chance = float(np.prod(same.mean(axis=0)))
    # More than half of the repetitions of the quietest channel beyond chance must be in rows that repeat as a whole.
    possible = float(same.mean(axis=0).min()) - chance
    error = 4.0 * math.sqrt(max(chance, 1.0 / len(sample)) / len(sample))
    return both - chance if both - chance > max(error, 0.5 * possible) else 0.0
