"""Lines that the poses of a session have in common, and the poses without them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import chdtri

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.channel_facts.pooled import as_measured, root_of
from trihedron.records.pose_noise import PoseLine

LINE_CHANCE = 1e-4
"""Probability that the poses of one axis show a line by chance."""
LONGEST_PIECE = 4096
"""Readings of a piece that a line is taken off at once: the frequency is known to a sixteenth of a period in it."""
FINER = 16
"""Frequencies tried per ordinate: half of one away from its middle a line loses 1/250 of its amplitude at most."""


def lines_of_poses(frequency: FloatArray, power: FloatArray, count: int, rate_hz: float) -> tuple[PoseLine, ...]:
    """Ordinates above their neighbourhood, of the lowest eight of which no period was seen often."""
    n = len(power)
    level = np.array([np.median(power[max(0, i - 16) : i + 17]) for i in range(n)])
    centre = (1.0 - 2.0 / (9.0 * count)) ** 3 if count > 1 else 0.4549
    ratio = power * centre / np.maximum(level, 1e-300)
    limit = float(chdtri(count, LINE_CHANCE / n)) / count
    # The neighbourhood's median is itself known to 1.25/√33 of a deviation.
    limit *= 1.0 + 3.0 * 1.25 * math.sqrt(2.0 / count / 33.0)
    out: list[PoseLine] = []
    taken = np.zeros(n, dtype=bool)
    taken[:8] = True
    for i in np.argsort(-ratio).tolist():
        if ratio[i] < limit or len(out) >= 8:
            break
        if taken[i]:
            continue
        near = slice(max(0, i - 3), min(n, i + 4))
        taken[near] = True
        floor = float(level[i] / centre)
        excess = float(np.sum(power[near] - floor))
        # Power of an ordinate over twice the length of its segment in seconds.
        square = 2.0 * max(excess, float(power[i] - floor)) * rate_hz / (n + 1)
        sigma_log = math.sqrt(2.0 / count) * math.sqrt(1.0 + 7.0 * (floor / max(excess, floor)) ** 2)
        amplitude = root_of(as_measured(square, sigma_log, math.inf), 1.0)
        out.append(PoseLine(float(frequency[i]), amplitude, float(ratio[i])))
    return tuple(sorted(out, key=lambda line: line.frequency_hz))


def without_lines(parts: Sequence[FloatArray], lines: Sequence[PoseLine], rate_hz: float) -> list[FloatArray]:
    """Poses (n,) each, less sinusoids at the frequencies of ``lines``, of each piece's own size and phase.

    What is left is scaled for the two degrees of freedom that a line takes: white noise keeps its power.
    """
    out = list(parts)
    for line in lines:
        pieces = [piece for part in out for piece in _pieces(part)]
        width = rate_hz / (2.0 * float(np.median([len(piece) for piece in pieces])))
        tried = line.frequency_hz + width * np.arange(-FINER, FINER + 1) / FINER
        tried = tried[(tried > 0.0) & (tried < 0.5 * rate_hz)] / rate_hz
        power = np.sum([_explained(piece, tried) for piece in pieces], axis=0)
        frequency = float(tried[int(np.argmax(power))])
        out = [np.concatenate([_less(piece, frequency) for piece in _pieces(part)]) for part in out]
    return out


def _pieces(part: FloatArray) -> list[FloatArray]:
    """Nearly equal pieces over which the search still knows a line's phase."""
    return np.array_split(part, -(-len(part) // LONGEST_PIECE))


def _explained(part: FloatArray, per_sample: FloatArray) -> FloatArray:
    """Sum of squares (k,) that a sinusoid explains, at evenly spaced frequencies in periods a sample."""
    step = float(per_sample[1] - per_sample[0]) if len(per_sample) > 1 else 0.0
    return _core.sinusoid_power(
        np.arange(len(part), dtype=np.float64),
        part - part.mean(),
        start_hz=float(per_sample[0]),
        step_hz=step,
        count=len(per_sample),
    )


def _less(part: FloatArray, per_sample: float) -> FloatArray:
    n = len(part)
    angle = 2.0 * np.pi * per_sample * np.arange(n)
    design = np.column_stack([np.ones(n), np.cos(angle), np.sin(angle)])
    found = np.linalg.lstsq(design, part, rcond=None)[0]
    left: FloatArray = found[0] + (part - design @ found) * math.sqrt(n / (n - 2.0))
    return left
