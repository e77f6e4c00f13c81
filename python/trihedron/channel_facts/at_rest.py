"""An axis in stretches of rest: its noise pooled over them, its lines and its spectrum."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.channel_facts.lines import lines_of_poses, without_lines
from trihedron.channel_facts.low_pass import Spectrum, undisturbed
from trihedron.channel_facts.pooled import Pooled, pooled_logarithm, robust_poses
from trihedron.channel_facts.step import converter_step
from trihedron.errors import RefusedError
from trihedron.ranges import ranges_of
from trihedron.records.pose_noise import PoseLine
from trihedron.transforms import cosine_transform

SHORTEST = 32
"""Readings of a pose that is used: fewer hold no octave below the uppermost two."""
LEAST_DITHER = 0.4
"""Noise over step below which the rounding is not noise of step²/12 any more, and what lies under it is hidden."""
LAGS = 8
"""Lags over which squared differences are correlated: filters of a sensor remember no more readings."""
LONGEST_SEGMENT = 4096
FEWER = 4.0 / 3.0
"""So many more readings are worth half the resolution at low frequencies."""


@dataclass(frozen=True, eq=False)
class AxisAtRest:
    """Poses of one axis without disturbed ones and lines, and what is pooled over them."""

    parts: list[FloatArray]
    step: float
    lines: tuple[PoseLine, ...]
    pooled: Pooled
    spectrum: Spectrum

    @classmethod
    def of(cls, x: FloatArray, rate_hz: float, poses: Sequence[tuple[int, int]], name: str) -> AxisAtRest:
        parts = [run for start, stop in poses for run in _unbroken(x[start:stop])]
        if not parts:
            raise RefusedError(f"{name}: no pose has {SHORTEST} readings in a row; keep the sensor still for longer")
        step = converter_step(np.concatenate(parts))
        power = _Power.of(parts)
        keep = robust_poses(power.variance, power.dof)
        parts = [part for part, kept in zip(parts, keep, strict=True) if kept]
        # A line is stated as one; it is neither white noise nor a filter's corner.
        spectrum = _segments(parts, rate_hz)
        lines = lines_of_poses(*spectrum, rate_hz)
        if lines:
            parts = without_lines(parts, lines, rate_hz)
            spectrum = _segments(parts, rate_hz)
        # Correlation and tails are those of what is kept: a knock would lend its own to all.
        power = _Power.of(parts)
        pooled = pooled_logarithm(power.variance, power.dof)
        whole = Spectrum(*_segments(parts, rate_hz, most=True), step**2 / 12.0 / rate_hz, pooled.scatter)
        beside = whole.beside([line.frequency_hz for line in lines])
        return cls(parts, step, lines, pooled, undisturbed(beside, rate_hz))

    @property
    def rounding(self) -> float:
        return self.step**2 / 12.0

    @property
    def total(self) -> float:
        """Half the mean squared difference of a typical pose."""
        return math.exp(self.pooled.mean)

    @property
    def is_dithered(self) -> bool:
        """Whether differences of readings are more than rounding."""
        return self.total > 0.0 and self.dithers(self.total - self.rounding)

    def dithers(self, variance: float) -> bool:
        """Whether a variance of one reading spreads over the LSB."""
        return self.step == 0.0 or variance > (LEAST_DITHER * self.step) ** 2


def _unbroken(part: FloatArray) -> list[FloatArray]:
    return [part[a:b] for a, b in ranges_of(np.isfinite(part)) if b - a >= SHORTEST]


@dataclass(frozen=True, eq=False)
class _Power:
    """Half the mean squared difference of each pose (k,), and its degrees of freedom (k,)."""

    variance: FloatArray
    dof: FloatArray

    @classmethod
    def of(cls, parts: Sequence[FloatArray]) -> _Power:
        """Of holds (n,) each; the correlation and the kurtosis of differences are those of all poses together."""
        squares = [np.diff(part) ** 2 for part in parts]
        mean = np.array([float(s.mean()) for s in squares])
        count = np.array([len(s) for s in squares], dtype=np.float64)
        # Relative to each pose's own level: holds may differ.
        about = [s / m - 1.0 for s, m in zip(squares, mean, strict=True) if m > 0.0]
        spread = np.zeros(LAGS + 1)
        for lag in range(LAGS + 1):
            products = [float(a[lag:] @ a[: len(a) - lag]) for a in about]
            spread[lag] = sum(products) / max(sum(len(a) - lag for a in about), 1)
        # White noise: 2 (1 + 2/4) = 3 per difference, two thirds of a degree of freedom each.
        per_difference = max(float(spread[0] + 2.0 * spread[1:].sum()), 0.5 * float(spread[0]), 1e-12)
        return cls(0.5 * mean, 2.0 * count / per_difference)


def _segments(parts: Sequence[FloatArray], rate_hz: float, *, most: bool = False) -> tuple[FloatArray, FloatArray, int]:
    """Frequencies (k,), mean power (k,) and number of segments of one length that most poses have.

    With ``most``, of half that length where more readings are in such segments by a third.
    """
    length = 1 << int(math.log2(max(SHORTEST, min(LONGEST_SEGMENT, float(np.median([len(p) for p in parts]))))))

    def used(n: int) -> int:
        return sum(len(part) // n * n for part in parts)

    if most and length > SHORTEST and used(length // 2) > used(length) * FEWER:
        length //= 2
    rows = [part[s : s + length] for part in parts for s in range(0, len(part) - length + 1, length)]
    stack = np.stack(rows)
    stack = stack - stack.mean(axis=1, keepdims=True)
    # A line's power in one ordinate depends on its phase there; the mean over segments does not.
    power = np.mean(cosine_transform(stack)[:, 1:] ** 2, axis=0) / rate_hz
    frequency: FloatArray = np.arange(1.0, length) * (rate_hz / (2.0 * length))
    return frequency, np.asarray(power), len(rows)
