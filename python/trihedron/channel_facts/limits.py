"""Limits of an ADC or a sensor: extreme values that readings end at, never a nominal range. The only place that
looks for them.

A value is a limit by several kinds of evidence that healthy readings give too seldom to matter: peaks that were
cut, readings that arrive steeply and stay, noise that ends abruptly, codes
that repeat or are read more often than those before them. From a channel
that stands still while all others stand still as well nothing follows: it is a pose, or a steady turn.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.channel_facts.ends import TO_SIGMA, End
from trihedron.probability import chdtrc
from trihedron.quantiles import median
from trihedron.records.channel_facts import Limit

STEEP = 5.0
"""The wall is reached by steps this many times the noise: a quiet sensor resting on its largest count is no wall."""
PILED = 3.0
"""And it holds this many times more samples than the neighbouring values lead up to."""
LEADS_UP = 0.01
"""Part of the span next to the wall in which those values lie."""

EQUAL = 0.5 / math.sqrt(math.pi)
"""Chance, for each LSB over the noise, that neighbours of independent noise are one code."""
LEAST_EQUAL = 0.01
"""Rows are written twice now and then, be it once in a hundred."""

NOISE_ALONE = 20.0
"""Standard deviations of the noise within which all readings of a log at rest lie; motion of no more is none."""
CARRIED = 0.5
"""Noise over LSB from which it carries the readings from one code to the next: below, a pose or a
value that is held looks like an end of the noise."""
ABRUPT = 0.6
"""A tail thins out towards its end: so much of the readings within a step and a half, on the end, is a cut."""
BESIDE = 1.5
FEWEST_CUT, LEAST_SHARE = 10, 1e-3
"""Readings on it, and their part of all, from which that can be told."""

BY_CHANCE = 1e-6
"""Chance that readings crowd on the outermost code of a sensor, or repeat there, in a healthy recording."""
DITHERED = 1.5
"""LSB over the noise (rounding in it) up to which the top of a smooth motion spreads over codes."""
REACHES = (1, 3, 40)
"""Codes next to the outermost one: a stretch that hardly moves reads the first as often as it, a slow peak the first
few more often than those far below, a quick one all alike."""
UNREAD = 1.0 / 3.0
"""Readings of a code that are expected where none of its neighbours was read."""


def is_wall(end: End, *, is_known: bool) -> bool:
    """Readings arrive steeply and stay, for more samples than the top of a smooth motion holds."""
    if end.count < 3:
        return False
    depth = LEADS_UP * end.span
    near, width = end.near(depth)
    # Towards the top of a smooth peak the density grows as one over the root of the distance, so the share of the
    # topmost level among all within `depth` is the root of its width.
    if end.count <= PILED * near * min(math.sqrt(width / depth), 1.0):
        return False
    values, runs = end.column, end.moving_runs
    starts, lengths = runs[:, 0], runs[:, 1] - runs[:, 0]
    before = np.abs(values[np.maximum(starts - 1, 0)] - end.value)
    after = np.abs(values[np.minimum(runs[:, 1], len(values) - 1)] - end.value)
    steep = (lengths >= 2) & (np.fmax(before, after) > STEEP * max(end.noise, width))
    # One stretch alone may be a channel that froze; at the end of an integer's range it is the range.
    return int(np.count_nonzero(steep)) >= (1 if is_known else 2)


def is_repeated(end: End, *, is_known: bool) -> bool:
    """Noise that moves the last digit leaves neighbours on the end equal more often than anywhere, however slowly it is
    reached."""
    runs = end.moving_runs
    lengths = runs[:, 1] - runs[:, 0]
    # One stretch alone may be a channel that froze, as above.
    if end.dither <= end.step or np.count_nonzero(lengths > 1) < (1 if is_known else 2):
        return False
    n, repeats = int(lengths.sum()), int(np.sum(lengths - 1))
    equal = max(EQUAL * end.step / end.dither, LEAST_EQUAL)
    if _at_least(repeats, n, equal) > BY_CHANCE:
        return False
    # Where rows are written again, neighbours are equal everywhere.
    usual = float(np.mean(np.concatenate([np.diff(part) for part in end.stretches]) == 0.0))
    return _at_least(repeats, n, max(equal, usual)) < BY_CHANCE


def _at_least(k: int, n: int, p: float) -> float:
    """Chernoff's bound of the chance of k or more of n, each with chance p."""
    share = k / n
    if share <= p:
        return 1.0
    return math.exp(-n * (share * math.log(share / p) + (1.0 - share) * math.log((1.0 - share) / (1.0 - p))))


def is_cut_noise(end: End) -> bool:
    """A log at rest whose noise ends abruptly: a tail thins out towards its end, a wall does not."""
    if end.dither <= CARRIED * end.step or end.span > NOISE_ALONE * end.noise:
        return False
    if end.count <= max(FEWEST_CUT, LEAST_SHARE * len(end.readings)):
        return False
    beside, _ = end.near(BESIDE * end.step)
    return end.count > ABRUPT * (end.count + beside)


def is_crowded(end: End) -> bool:
    """One end is read more often than motion reads it (:func:`crowded_together` of one channel)."""
    return _chance([end]) < BY_CHANCE


def crowded_together(ends: list[End]) -> list[End]:
    """The ends of one outermost code, the same in size on every channel that comes so far, if readings crowd on it.

    A range that ends just above 1 g stops no more than a few readings of each of several channels. Motion reads its
    outermost code once, and the codes below it at least as often as that one: how many more there are is Poisson's.
    """
    if not ends:
        return []
    outermost = max(abs(end.value) for end in ends)
    alike = [end for end in ends if outermost - abs(end.value) <= 0.5 * end.step and (end.value > 0.0) == end.is_high]
    return alike if _chance(alike) < BY_CHANCE else []


def _chance(ends: list[End]) -> float:
    """Chance that motion reads these ends as often as they are read."""
    told = [end for end in ends if 0.0 < end.step < DITHERED * end.noise]
    if sum(end.count for end in told) <= len(told):
        return 1.0
    told = [end for end in told if end.step < DITHERED * end.dither]
    spare = sum(end.count for end in told) - len(told)
    if spare <= 0:
        return 1.0
    expected = sum(max(UNREAD, *(end.near((reach + 0.5) * end.step)[0] / reach for reach in REACHES)) for end in told)
    # At least so many of a Poisson law: a chi-square of twice as many degrees below twice its mean.
    return 1.0 - chdtrc(2.0 * spare, 2.0 * expected)


FEWEST = 8
"""Readings from which an end is told."""
FEWEST_CODES = 100.0
"""From so many steps on, two channels end at one code hardly by chance."""
SHORTEST_WORD = 128.0
"""Codes of a word of seven bits and a sign, the shortest: smaller powers of two are met by chance."""


Extremes = list[tuple[float, int, float, int]]
"""Of every axis: the lowest reading, how often it was read, the highest, how often."""


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
    # A peak that was written three times over is no plateau.
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
    # Channels of one part that come as far end there too, be it for a single reading.
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
    """The code at the end of a word of bits: 2^k - 1, or -2^k, in counts; codes of converted units are not known."""
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
    return (
        is_cut(end, is_known=is_known, is_word=is_word)
        or is_wall(end, is_known=is_word)
        or is_repeated(end, is_known=is_word)
        or is_cut_noise(end)
        or is_crowded(end)
    )


def _is_same_code(one: End, other: End) -> bool:
    """Whether two ends are one limit: both ends of a word are a step apart, ends on one side are the same."""
    if one.step <= 0.0:
        return abs(one.value) == abs(other.value)
    apart = 0.1 if one.value * other.value > 0.0 else 1.1
    return abs(one.value) >= FEWEST_CODES * one.step and abs(abs(one.value) - abs(other.value)) < apart * one.step


# Readings that a logger wrote again because its sensor had no new one: each is one reading, however often written.

JUMP_STEPS, JUMP_NOISE = 4.0, 5.0
"""A change from row to row beyond so many steps, and standard deviations of a reading, is motion."""
OFTEN = 0.2
"""Part of the jumps that come after a repeated triad. Three axes of a sensor that moves by steps in every row repeat
together next to never, but in the peaks that all three limits cut at once; a held sensor's do before nearly all."""
FEWEST_JUMPS = 20


def new_readings(readings: FloatArray, noise: FloatArray, step: FloatArray) -> IntArray | None:
    """Rows of a triad (n, 3) that hold a new reading, ``None`` where every row does.

    ``noise`` (3,) of one sample at rest and ``step`` (3,) of the ADC, in the unit of the readings.
    """
    change = np.abs(np.diff(readings, axis=0))
    same = ~np.any(change, axis=1)
    jumps: npt.NDArray[np.intp] = np.flatnonzero(np.any(change > JUMP_STEPS * step + JUMP_NOISE * noise, axis=1))
    jumps = jumps[jumps > 0]
    if len(jumps) < FEWEST_JUMPS or np.mean(same[jumps - 1]) < OFTEN:
        return None
    return np.concatenate([[0], np.flatnonzero(~same) + 1])


def with_repeats(limit_runs: IntArray, rows: IntArray, n: int) -> IntArray:
    """Runs (k, 2) among new readings as runs among all ``n`` rows; ``rows`` are those of the new ones."""
    ends = np.append(rows, n)
    return np.stack([rows[limit_runs[:, 0]], ends[limit_runs[:, 1]]], axis=1)


# Peaks that a limit has cut: readings jump to it and from it further than a smooth peak inside one code would.

FAR = 0.3
"""Part of an axis' span that lies between a limit and where the sensor mostly is."""
TOP = 3.0
"""Sharper by this much than that parabola falls a peak upon which a tremor rides."""
PAIR_BEND = 8.0
"""Bend, in steps, that two equal samples are allowed: more is no evidence by itself."""
NOISE_JUMP = 5.0
"""Standard deviations of a reading that noise alone may jump at the two ends of a peak's top, in all peaks of a log."""
MOST_RUNS = 1000
"""Runs that are looked at, evenly spread where there are more."""


def is_cut(end: End, *, is_known: bool, is_word: bool = False) -> bool:
    """Some of the runs on an end far from where the axis mostly is are no smooth peak that happens to share a code.

    A parabola of which n samples stay within a step q has a curvature of at most 8 q/((n − 1)² − 1), n even, or
    8 q/(n − 1)², n odd. One sample further it has fallen by half of that times n, two further by that times n + 1;
    a tremor makes it steeper (``TOP``), rounding may add a step, and noise its own jumps. The readings fall by more at
    *both* ends of a run that was cut: a turn at a steady rate begins and ends steeply and meanwhile wavers about its
    extreme. Two equal samples may lie on either side of any peak: they are the limit's only where it ``is_known``
    otherwise, or two peaks end at it. Standing still at the end of a word is the limit's too; on a code that another
    channel ends at as well it may be a table's steady turn one way and the other.
    """
    column = end.column
    if not end.lasts or abs(end.value - end.middle) <= FAR * end.span:
        return False
    runs = end.runs if is_word else end.moving_runs
    runs = runs[np.diff(runs, axis=1)[:, 0] > 1]
    steps = np.abs(np.concatenate([np.diff(part[np.isfinite(part)]) for part in end.stretches]))
    noise = TO_SIGMA * median(steps) / np.sqrt(2.0) if len(steps) else 0.0
    pairs = 0
    for first, stop in runs[:: max(1, -(-len(runs) // MOST_RUNS))].tolist():
        if _falls_on_both_sides(column, first, stop, end.step, noise):
            if is_known or stop - first > 2:
                return True
            pairs += 1
    return pairs > 1


def _falls_on_both_sides(column: FloatArray, first: int, stop: int, step: float, noise: float) -> bool:
    count = stop - first
    bend = TOP * 8.0 / ((count - 1) ** 2 - (1 - count % 2)) if count > 2 else PAIR_BEND
    smooth = step * (1.0 + bend * np.array([0.5 * count, count + 1.0])) + NOISE_JUMP * noise
    sides = (column[stop : stop + 2], column[max(first - 2, 0) : first][::-1])
    return all(np.any(np.abs(side - column[first]) > smooth[: len(side)]) for side in sides if np.isfinite(side).any())
