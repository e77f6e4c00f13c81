"""Ends that are read more often than what leads up to them: walls, noise that ends abruptly, codes piled up."""

from __future__ import annotations

import math

import numpy as np

from trihedron.channel_facts.ends import End
from trihedron.probability import chdtrc

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
NEAR, NEIGHBOURS = 3, 40
"""Codes next to the outermost one: a slow peak reads all of the first few more often than those far below, a quick one
all alike."""


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
    repeats = int(np.sum(lengths - 1))
    equal = max(EQUAL * end.step / end.dither, LEAST_EQUAL)
    if equal**repeats > BY_CHANCE:
        return False
    # Where rows are written again, neighbours are equal everywhere.
    return (
        max(equal, float(np.mean(np.concatenate([np.diff(part) for part in end.stretches]) == 0.0))) ** repeats
        < BY_CHANCE
    )


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
    expected = sum(
        max(max(end.near((reach + 0.5) * end.step)[0], 1) / reach for reach in (NEAR, NEIGHBOURS)) for end in told
    )
    # At least so many of a Poisson law: a chi-square of twice as many degrees below twice its mean.
    return 1.0 - chdtrc(2.0 * spare, 2.0 * expected)
