"""Range limits of an ADC or a sensor, detected from extreme values of readings, never from a nominal range. No other
module searches for them.

Three kinds of evidence make a value a limit, each rare enough in healthy readings: clipped peaks, noise that ends
abruptly, and codes that are read more often than those before them.
A channel that stands still while all others stand still too is no evidence: it is a pose, or a constant rate.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.probability import chdtrc
from trihedron.quantiles import MAD_TO_SIGMA, median
from trihedron.records.channel_facts import Limit

FLAT = 1.5
"""Peak-to-peak, in LSB, of a static channel between two codes; hand motion and tremor are far larger."""
STILL = 8
"""Readings on an extreme from which all channels are tested for standstill: slow motion takes fewer."""
ORDER, GAIN = 4, np.sqrt(70.0)
"""Order of differences that remove motion, and their standard deviation for white noise of 1."""
WHITE = 0.2
"""Least share of the static noise that they must show: filters leave as much; less indicates a noise that is motion."""
PROBED = 1 << 14
"""Readings, in ``STRETCHES`` parts evenly spread over the log, that give its scatter and its median."""
STRETCHES = 16


@dataclass(frozen=True, eq=False)
class End:
    """The largest or smallest ``value`` of an axis of ``readings`` (n, 3), read ``count`` times.

    ``span`` is the range of the axis, ``noise`` that of one static sample, ``steps`` (3,) the LSB of the axes.
    """

    readings: FloatArray
    axis: int
    value: float
    is_high: bool
    count: int
    span: float
    noise: float
    steps: FloatArray

    @property
    def step(self) -> float:
        """LSB of this axis; with too few codes to show one, the largest of the others."""
        return float(self.steps[self.axis] or np.max(self.steps))

    @property
    def column(self) -> FloatArray:
        """(n,) readings of the axis."""
        return self.readings[:, self.axis]

    def near(self, depth: float) -> int:
        """Number of other readings within ``depth`` of the extreme."""
        within, _, at = _core.readings_near(self.readings, self.axis, self.value, depth)
        return within - len(at)

    @cached_property
    def runs(self) -> IntArray:
        """(k, 2) first sample of every run of readings on the extreme, and one past its last."""
        at: IntArray = _core.readings_near(self.readings, self.axis, self.value, 0.0)[2]
        breaks = np.flatnonzero(np.diff(at) > 1)
        return np.stack([np.concatenate([at[:1], at[breaks + 1]]), np.concatenate([at[breaks], at[-1:]]) + 1], axis=1)

    @cached_property
    def stretches(self) -> list[FloatArray]:
        """Parts of the column, evenly spread, that represent a long log."""
        column, length = self.column, PROBED // STRETCHES
        if len(column) <= PROBED:
            return [column]
        starts = np.linspace(0, len(column) - length, STRETCHES).astype(int)
        return [column[first : first + length] for first in starts]

    @property
    def middle(self) -> float:
        """Median of the axis."""
        seen = np.concatenate(self.stretches)
        seen = seen[np.isfinite(seen)]
        return median(seen) if len(seen) else float(np.nanmedian(self.column))

    @cached_property
    def dither(self) -> float:
        """Noise of one sample that dithers the LSB, 0 where it may be motion."""
        rough = np.abs(np.concatenate([np.diff(part, ORDER) for part in self.stretches]))
        rough = rough[np.isfinite(rough)]
        seen = MAD_TO_SIGMA * median(rough) / GAIN if len(rough) else 0.0
        return min(seen, self.noise) if seen > WHITE * self.noise else 0.0

    @property
    def lasts(self) -> bool:
        """Whether neighbouring samples have the extreme value."""
        return self.count > 1 and bool(np.max(np.diff(self.runs, axis=1)) > 1)

    @cached_property
    def moving_runs(self) -> IntArray:
        """The runs (k, 2) without those in which every channel stands still: these are poses, or constant rates.

        An ADC coarser than the noise shows both as one code of any value. Motion beyond a sensor's range moves the
        other axes too, and noise that moves their last digit is no standstill.
        """
        others = [k for k in range(3) if k != self.axis]
        keep = np.ones(len(self.runs), dtype=np.bool_)
        for k in np.flatnonzero(np.diff(self.runs, axis=1)[:, 0] >= STILL).tolist():
            first, stop = self.runs[k].tolist()
            keep[k] = not self._stands_still(first, stop, others)
        return self.runs[keep]

    def _stands_still(self, first: int, stop: int, others: list[int]) -> bool:
        # Without its edges: the motion begins and ends while the axis is at its extreme code.
        edge = max((stop - first) // 6, 1)
        part = self.readings[first + edge : stop - edge, others]
        return bool(np.all(np.ptp(part, axis=0) < FLAT * float(np.max(self.steps))))


NOISE_ALONE = 20.0
"""Standard deviations of the noise that contain all readings of a static log; less motion than that counts as none."""
CARRIED = 0.5
"""Noise over LSB from which it moves readings from one code to the next: below, a pose or a constant value looks like a
limit."""
ABRUPT = 0.6
"""A tail of noise thins out: this share of the readings within 1.5 LSB of an extreme, on it, indicates clipping."""
BESIDE = 1.5
FEWEST_CUT, LEAST_SHARE = 10, 1e-3
"""Readings on it, and their share of all, that this test needs."""

BY_CHANCE = 1e-6
"""False-alarm probability of readings that crowd on the outermost code of a sensor."""
DITHERED = 1.5
"""LSB over noise (rounding included) up to which the top of a smooth motion spreads over codes."""
REACHES = (1, 3, 40)
"""Numbers of codes next to the outermost one: a channel that hardly moves reads the first as often as it, a slow peak
the first few more often than those far below, a quick one all equally often."""
UNREAD = 1.0 / 3.0
"""Expected readings of a code where none of its neighbours was read."""


def is_cut_noise(end: End) -> bool:
    """Whether the noise of a static log ends abruptly: a tail thins out towards its end, clipped noise does not."""
    if end.dither <= CARRIED * end.step or end.span > NOISE_ALONE * end.noise:
        return False
    if end.count <= max(FEWEST_CUT, LEAST_SHARE * len(end.readings)):
        return False
    return end.count > ABRUPT * (end.count + end.near(BESIDE * end.step))


def crowded_together(ends: list[End]) -> list[End]:
    """The extremes of one outermost code, the same in size on every channel that reaches it, if readings crowd on it.

    A range that ends just above 1 g clips no more than a few readings of each of several channels. Motion reads its
    outermost code once, and the codes below at least as often: the number beyond that has a Poisson distribution.
    """
    if not ends:
        return []
    outermost = max(abs(end.value) for end in ends)
    alike = [end for end in ends if outermost - abs(end.value) <= 0.5 * end.step and (end.value > 0.0) == end.is_high]
    return alike if _chance(alike) < BY_CHANCE else []


def _chance(ends: list[End]) -> float:
    """Probability that motion reads these extremes as often as they are read."""
    told = [end for end in ends if 0.0 < end.step < DITHERED * end.noise]
    if sum(end.count for end in told) <= len(told):
        return 1.0
    told = [end for end in told if end.step < DITHERED * end.dither]
    spare = sum(end.count for end in told) - len(told)
    if spare <= 0:
        return 1.0
    expected = sum(max(UNREAD, *(end.near((reach + 0.5) * end.step) / reach for reach in REACHES)) for end in told)
    # Poisson probability of at least so many: a chi-square of twice as many degrees of freedom below twice its mean.
    return 1.0 - chdtrc(2.0 * spare, 2.0 * expected)


FEWEST = 8
"""Fewest readings of a log that is tested."""
FEWEST_CODES = 100.0
"""Codes from which two channels hardly have one extreme code by chance."""
SHORTEST_WORD = 128.0
"""Codes of a word of seven bits and a sign, the shortest: smaller powers of two occur by chance."""


Extremes = list[tuple[float, int, float, int]]
"""For every axis: the lowest reading, its count, the highest reading, its count."""


def find_limits(
    readings: FloatArray, noise: FloatArray, step: FloatArray, extremes: Extremes | None = None
) -> tuple[Limit, ...]:
    """Limits of a triad (n, 3) with ``noise`` (3,) of one sample at rest and ``step`` (3,) of the ADC; its
    ``extremes`` where they are known.
    """
    found = _limits(readings, noise, step, extremes)
    rows = new_readings(readings, noise, step) if found else None
    if rows is None:
        return found
    # Repeats of one reading of a peak are no plateau.
    return tuple(
        replace(limit, runs=with_repeats(limit.runs, rows, len(readings)))
        for limit in _limits(readings[rows], noise, step, None)
    )


def _limits(readings: FloatArray, noise: FloatArray, step: FloatArray, extremes: Extremes | None) -> tuple[Limit, ...]:
    if len(readings) < FEWEST:
        return ()
    ends = [
        End(readings, axis, value, is_high, count, high - low, float(noise[axis]), step)
        for axis, (low, n_low, high, n_high) in enumerate(extremes or _core.triad_extremes(readings))
        if low < high and not math.isinf(low) and not math.isinf(high)
        for value, count, is_high in ((high, n_high, True), (low, n_low, False))
    ]
    lasting = [end for end in ends if end.lasts]
    found = [end for end in ends if _is_limit(end, lasting)]
    found += [end for end in crowded_together(ends) if end not in found]
    # Channels of one part with the same extreme code have the limit too, even with a single reading.
    found += [end for end in ends if end not in found and any(_is_same_code(end, other) for other in found)]
    return tuple(
        Limit(end.axis, end.value, end.is_high, end.runs, is_word=is_end_of_word(end.value, end.step))
        for end in ends
        if end in found
    )


def share_at_limits(readings: FloatArray, noise: float, step: float) -> float:
    """Share of one channel's readings (n,) that lie at its limits."""
    alone = np.zeros((len(readings), 3))
    alone[:, 0] = readings
    limits = find_limits(alone, np.array([noise, 0.0, 0.0]), np.array([step, 0.0, 0.0]))
    return sum(limit.count for limit in limits) / max(len(readings), 1)


def is_end_of_word(value: float, step: float) -> bool:
    """Whether a code is the end of a word: 2^k - 1, or -2^k, in counts; codes of converted units are not known."""
    code = value / step if step >= 1.0 else 0.0
    if code != round(code) or abs(code) < SHORTEST_WORD - 1.0:
        return False
    magnitude = int(code) + 1 if code > 0 else -int(code)
    return magnitude & (magnitude - 1) == 0


def _is_limit(end: End, lasting: list[End]) -> bool:
    if end.count < 2:
        return False
    is_word = is_end_of_word(end.value, end.step)
    is_known = is_word or any(_is_same_code(end, other) for other in lasting if other is not end)
    # Without an LSB no two extremes are alike by chance.
    if is_known and end.step <= 0.0 and end.lasts:
        return True
    return is_cut(end, is_known=is_known, is_word=is_word) or is_cut_noise(end) or _chance([end]) < BY_CHANCE


def _is_same_code(one: End, other: End) -> bool:
    """Whether two extremes are one limit: both ends of a word are an LSB apart in size, ends on one side are equal."""
    if one.step <= 0.0:
        return abs(one.value) == abs(other.value)
    apart = 0.1 if one.value * other.value > 0.0 else 1.1
    return abs(one.value) >= FEWEST_CODES * one.step and abs(abs(one.value) - abs(other.value)) < apart * one.step


# Rows that a logger wrote again without a new reading: each reading counts once, however often it is written.

JUMP_STEPS, JUMP_NOISE = 4.0, 5.0
"""LSB and standard deviations of a reading beyond whose sum a change from row to row is motion."""
OFTEN = 0.2
"""Share of the motion steps that follow a repeated triad. Three axes that move in every row hardly repeat together,
except where all three are clipped; with repeated readings nearly all steps follow a repeat."""
FEWEST_JUMPS = 20


def new_readings(readings: FloatArray, noise: FloatArray, step: FloatArray) -> IntArray | None:
    """Rows of a triad (n, 3) that have a new reading, ``None`` where every row has.

    ``noise`` (3,) of one sample at rest and ``step`` (3,) of the ADC, in the unit of the readings.
    """
    change = np.abs(np.diff(readings, axis=0))
    same = ~np.any(change, axis=1)
    jumps: IntArray = np.flatnonzero(np.any(change > JUMP_STEPS * step + JUMP_NOISE * noise, axis=1))
    jumps = jumps[jumps > 0]
    if len(jumps) < FEWEST_JUMPS or np.mean(same[jumps - 1]) < OFTEN:
        return None
    return np.concatenate([[0], np.flatnonzero(~same) + 1])


def with_repeats(limit_runs: IntArray, rows: IntArray, n: int) -> IntArray:
    """Runs (k, 2) among new readings as runs among all ``n`` rows; ``rows`` are those of the new ones."""
    ends = np.append(rows, n)
    return np.stack([rows[limit_runs[:, 0]], ends[limit_runs[:, 1]]], axis=1)


# Clipped peaks: readings step to the limit and from it further than a smooth peak inside one code would.

FAR = 0.3
"""Least distance of a limit from the median of the axis, as a share of its span."""
TOP = 3.0
"""Factor on the curvature of a smooth peak that allows for a tremor on it."""
PAIR_BEND = 8.0
"""Curvature, in LSB, that two equal samples are allowed; more is no evidence alone."""
NOISE_JUMP = 5.0
"""Standard deviations of a reading that noise alone may step at both ends of a peak's top, over all peaks of a log."""
LEVELLED = 3.0
"""Standard errors of its curvature by which noise may level the top of a peak, the highest of a log."""
MOST_RUNS = 1000
"""Runs that are tested, evenly spread where there are more."""


def is_cut(end: End, *, is_known: bool, is_word: bool = False) -> bool:
    """Whether some runs on an extreme far from the median of the axis are no smooth peak that falls into one code.

    A parabola of which n samples stay within a step q has a curvature of at most 8 q/((n − 1)² − 1), n even, or
    8 q/(n − 1)², n odd. One sample further it has fallen by half of that times n, two further by that times n + 1;
    a tremor makes it steeper (``TOP``), rounding may add a step, and noise levels it (``LEVELLED``). The readings fall
    by more at *both* ends of a clipped run; a rotation at a constant rate begins and ends steeply too, but varies about
    its extreme in between. Two equal samples may lie on either side of any peak: they count only where the limit
    ``is_known`` otherwise, or two peaks end at it. Standstill at the end of a word counts as the limit too; on a code
    that is another channel's extreme as well it may be a table's constant rate in both directions.
    """
    column = end.column
    if not end.lasts or abs(end.value - end.middle) <= FAR * end.span:
        return False
    runs = end.runs if is_word else end.moving_runs
    runs = runs[np.diff(runs, axis=1)[:, 0] > 1]
    steps = np.abs(np.concatenate([np.diff(part[np.isfinite(part)]) for part in end.stretches]))
    noise = MAD_TO_SIGMA * median(steps) / np.sqrt(2.0) if len(steps) else 0.0
    pairs = 0
    for first, stop in runs[:: max(1, -(-len(runs) // MOST_RUNS))].tolist():
        if _falls_on_both_sides(column, first, stop, end.step, noise):
            if is_known or stop - first > 2:
                return True
            pairs += 1
    return pairs > 1


def _falls_on_both_sides(column: FloatArray, first: int, stop: int, step: float, noise: float) -> bool:
    n = stop - first
    bend = PAIR_BEND * step
    if n > 2:
        # Noise may level a peak: its curvature is uncertain by that of a least-squares parabola through n samples.
        levelled = LEVELLED * noise * np.sqrt(720.0 / (n * (n**2 - 1) * (n**2 - 4)))
        bend = TOP * 8.0 * step / ((n - 1) ** 2 - (1 - n % 2)) + levelled
    smooth = step + bend * np.array([0.5 * n, n + 1.0]) + NOISE_JUMP * noise
    sides = (column[stop : stop + 2], column[max(first - 2, 0) : first][::-1])
    return all(np.any(np.abs(side - column[first]) > smooth[: len(side)]) for side in sides if np.isfinite(side).any())
