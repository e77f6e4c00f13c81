"""An axis in static intervals: its pooled noise, its spectral lines, its spectrum and its low-pass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, FloatArray
from trihedron.channel_facts.low_pass import Spectrum, low_passes, undisturbed
from trihedron.channel_facts.pooled import Pooled, pooled_logarithm, robust_poses
from trihedron.channel_facts.quiet import look
from trihedron.errors import InputError
from trihedron.probability import RARE_ALARM, chdtri
from trihedron.ranges import merged, ranges_of
from trihedron.records.channel_facts import LowPass
from trihedron.transforms import cosine_transform

PROBED = 1 << 14
"""Readings, evenly spread over a channel, that are searched for a grid: sorting them takes half a millisecond."""
TESTABLE = 8
"""Least number of levels for a test of a grid (``rust/adc_grid.rs``, which has the grid's own limits)."""
REPEATS = 2
"""Readings per level, at least, where levels are few."""
SINGLE = 2.0**-23
"""Relative size of the last bit in single precision."""
PARTS = 8
"""Parts of a log without one grid that are tested separately: its range may change, or its sensor."""


def probe_stride(n: int) -> int:
    """Spacing of the readings of a log of n that are searched for a grid."""
    return max(1, -(-n // PROBED))


def adc_step(readings: FloatArray) -> float:
    """LSB of readings (n,), the spacing of the grid they lie on, in their unit; 0 without a visible grid.

    Readings in counts, in units converted from counts, and decimals as written are treated alike. Where codes between
    the levels are missing, the step is the one that all gaps are multiples of. For a log that changes its step, that of
    most of its parts is returned; of two that are multiples of a third, the third. The last bit of readings in single
    precision is no step of an ADC.

    Examples
    --------
    >>> import numpy as np
    >>> noise = np.random.default_rng(1).normal(size=2000)
    >>> adc_step(0.25 * np.round(2.0 * noise)), adc_step(noise)
    (0.25, 0.0)
    """
    seen = np.ascontiguousarray(readings[:: probe_stride(len(readings))])
    levels, n = _core.levels_of(seen)
    step = _core.adc_grid(levels, n) or 0.0
    if 0.0 < step < 1.0 and step <= SINGLE * np.abs(levels).max() and _is_power_of_two(step):
        return 0.0
    # Where most levels occur once, the step is far below the noise and does not matter.
    if step or len(levels) < TESTABLE or REPEATS * len(levels) > n:
        return step
    parts = [_core.levels_of(part) for part in np.array_split(seen, PARTS)]
    steps = [_core.adc_grid(*part) or 0.0 for part in parts if len(part[0]) > TESTABLE]
    return float(np.median(steps)) if steps and all(steps) else 0.0


def _is_power_of_two(step: float) -> bool:
    exponent = math.log2(step)
    return abs(exponent - round(exponent)) < 1e-6


def adc_steps(readings: FloatArray) -> FloatArray:
    """(c,) LSB of every column of (n, c)."""
    return np.array([adc_step(column) for column in readings.T], dtype=np.float64)


SHORTEST = 32
"""Readings of a pose that is used: fewer contain no octave below the highest two."""
LEAST_DITHER = 0.4
"""Noise over LSB below which rounding is not noise of LSB²/12 any more, and hides the noise."""
LAGS = 8
"""Lags over which squared differences are correlated: filters of a sensor have no longer memory."""
LONGEST_SEGMENT = 4096
FEWER = 4.0 / 3.0
"""Ratio of readings used that is worth half the resolution at low frequencies."""


@dataclass(frozen=True, eq=False)
class StaticAxis:
    """Poses of one axis without disturbed ones and lines, and their pooled noise."""

    parts: list[FloatArray]
    step: float
    pooled: Pooled
    spectrum: Spectrum

    @classmethod
    def of(cls, x: FloatArray, rate_hz: float, poses: Sequence[tuple[int, int]], name: str) -> StaticAxis:
        inside = [(x[start:stop], ranges_of(np.isfinite(x[start:stop]))) for start, stop in poses]
        parts = [pose[a:b] for pose, runs in inside for a, b in runs if b - a >= SHORTEST]
        if not parts:
            raise InputError(f"{name}: no pose has {SHORTEST} readings in a row; keep the sensor still for longer")
        step = adc_step(np.concatenate(parts))
        keep = robust_poses(*_power_of(parts))
        parts = [part for part, kept in zip(parts, keep, strict=True) if kept]
        # A line is neither white noise nor a filter's corner.
        spectrum = _segments(parts, rate_hz)
        lines = lines_of_poses(*spectrum)
        if lines:
            parts = without_lines(parts, lines, rate_hz)
            spectrum = _segments(parts, rate_hz)
        # Correlation and tails are those of the remaining poses: a disturbed one would change them for all.
        pooled = pooled_logarithm(*_power_of(parts))
        whole = Spectrum(*_segments(parts, rate_hz, most=True), step**2 / 12.0 / rate_hz, pooled.scatter)
        beside = whole.beside(lines)
        return cls(parts, step, pooled, undisturbed(beside, rate_hz))

    @property
    def rounding(self) -> float:
        return self.step**2 / 12.0

    @property
    def total(self) -> float:
        """Half the mean squared difference of a typical pose."""
        return math.exp(self.pooled.mean)

    @property
    def is_dithered(self) -> bool:
        """Whether differences of readings contain more than rounding."""
        return self.total > 0.0 and self.dithers(self.total - self.rounding)

    def dithers(self, variance: float) -> bool:
        """Whether noise of this variance dithers the LSB."""
        return self.step == 0.0 or variance > (LEAST_DITHER * self.step) ** 2


def _power_of(parts: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Half the mean squared difference of each pose (n,), and its degrees of freedom, (k,) each.

    Correlation and kurtosis of differences are pooled over the poses.
    """
    squares = [np.diff(part) ** 2 for part in parts]
    mean = np.array([float(s.mean()) for s in squares])
    count = np.array([len(s) for s in squares], dtype=np.float64)
    # Relative to the level of each pose, which may differ.
    about = [s / m - 1.0 for s, m in zip(squares, mean, strict=True) if m > 0.0]
    spread = np.zeros(LAGS + 1)
    for lag in range(LAGS + 1):
        products = [float(a[lag:] @ a[: len(a) - lag]) for a in about]
        spread[lag] = sum(products) / max(sum(len(a) - lag for a in about), 1)
    # White noise: 2 (1 + 2/4) = 3 per difference, two thirds of a degree of freedom each.
    per_difference = max(float(spread[0] + 2.0 * spread[1:].sum()), 0.5 * float(spread[0]), 1e-12)
    return 0.5 * mean, 2.0 * count / per_difference


def _segments(parts: Sequence[FloatArray], rate_hz: float, *, most: bool = False) -> tuple[FloatArray, FloatArray, int]:
    """Frequencies (k,), mean power (k,) and number of segments, of a length that most poses have.

    With ``most``, of half that length where this uses a third more readings.
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


# Spectral lines common to the poses of a session, and the poses without them.

LONGEST_PIECE = 4096
"""Readings of a piece that a line is subtracted from: the frequency error is a sixteenth of a period in it."""
FINER = 16
"""Frequencies tried per ordinate: half a step off its frequency a line loses at most 1/250 of its amplitude."""


def lines_of_poses(frequency: FloatArray, power: FloatArray, count: int) -> list[float]:
    """Frequencies [Hz] of ordinates above their neighbourhood, without the lowest eight of few periods per segment."""
    n = len(power)
    level = np.array([np.median(power[max(0, i - 16) : i + 17]) for i in range(n)])
    centre = (1.0 - 2.0 / (9.0 * count)) ** 3 if count > 1 else 0.4549
    ratio = power * centre / np.maximum(level, TINY)
    limit = chdtri(count, RARE_ALARM / n) / count
    # The relative error of the neighbourhood's median is 1.25/√33 of a deviation.
    limit *= 1.0 + 3.0 * 1.25 * math.sqrt(2.0 / count / 33.0)
    out: list[float] = []
    taken = np.zeros(n, dtype=bool)
    taken[:8] = True
    for i in np.argsort(-ratio).tolist():
        if ratio[i] < limit or len(out) >= 8:
            break
        if taken[i]:
            continue
        taken[max(0, i - 3) : i + 4] = True
        out.append(float(frequency[i]))
    return sorted(out)


def without_lines(parts: Sequence[FloatArray], lines: Sequence[float], rate_hz: float) -> list[FloatArray]:
    """Poses (n,) each, less sinusoids at the frequencies ``lines`` [Hz], with size and phase fitted to each piece.

    The residuals are scaled for the two degrees of freedom of a line: white noise keeps its power.
    """
    out = list(parts)
    for line in lines:
        pieces = [piece for part in out for piece in _pieces(part)]
        width = rate_hz / (2.0 * float(np.median([len(piece) for piece in pieces])))
        tried = line + width * np.arange(-FINER, FINER + 1) / FINER
        tried = tried[(tried > 0.0) & (tried < 0.5 * rate_hz)] / rate_hz
        power = np.sum([_explained(piece, tried) for piece in pieces], axis=0)
        frequency = float(tried[int(np.argmax(power))])
        out = [np.concatenate([_less(piece, frequency) for piece in _pieces(part)]) for part in out]
    return out


def _pieces(part: FloatArray) -> list[FloatArray]:
    """Nearly equal pieces, short enough for the phase error of the frequency found."""
    return np.array_split(part, -(-len(part) // LONGEST_PIECE))


def _explained(part: FloatArray, per_sample: FloatArray) -> FloatArray:
    """Sum of squares (k,) that a sinusoid explains, at evenly spaced frequencies in periods per sample."""
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
    out: FloatArray = found[0] + (part - design @ found) * math.sqrt(n / (n - 2.0))
    return out


# The low-pass of each channel, from the static intervals of a log.

IN_A_ROW = 16
"""Consecutive windows that are taken together from a long log: intervals of eight seconds."""


def find_low_passes(sensors: dict[str, FloatArray], rate_hz: float) -> dict[str, tuple[LowPass, ...]]:
    """Low-passes of the three channels of each sensor (n, 3) by name; none where no quiet interval is long enough.

    The method is that for poses (:func:`trihedron.channel_facts.low_pass.low_passes`), applied to the quietest
    intervals of the log: a filter shows in the white noise of a static sensor.
    """
    windows = look(sensors, rate_hz, in_a_row=IN_A_ROW)
    if windows is None:
        return {}
    # Consecutive windows are one interval.
    stretches = merged((a, a + windows.length) for a in windows.start[windows.quiet].tolist())
    found = {}
    for name, readings in sensors.items():
        try:
            axes = [StaticAxis.of(readings[:, c], rate_hz, stretches, name) for c in range(3)]
        except InputError:
            continue  # fewer than 32 readings in a row
        found[name] = tuple(low_passes([axis.spectrum for axis in axes], rate_hz))
    return found
