"""Limits of an ADC or a sensor: extreme values that readings end at, never a nominal range. The only place that
looks for them.

A value is a limit by several kinds of evidence that healthy readings give too seldom to matter: peaks that were
cut (:mod:`~trihedron.channel_facts.cut_peaks`), readings that arrive steeply and stay, noise that ends abruptly, codes
that repeat or are read more often than those before them (:mod:`~trihedron.channel_facts.crowded_ends`). From a channel
that stands still while all others stand still as well nothing follows: it is a pose, or a steady turn.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.channel_facts.crowded_ends import crowded_together, is_crowded, is_cut_noise, is_repeated, is_wall
from trihedron.channel_facts.cut_peaks import is_cut
from trihedron.channel_facts.ends import End
from trihedron.channel_facts.held import new_readings, with_repeats
from trihedron.records.channel_facts import Limit

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
