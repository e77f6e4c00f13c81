"""The log as short blocks of all channels, on which the whole segmentation works."""

from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.channel_facts.static_axes import adc_steps, probe_stride
from trihedron.records import Recording
from trihedron.session.rounding import undithered_axes

BLOCK_S = 0.1
"""Shorter than any hand motion (a few hertz), long enough for a variance at 50 Hz and more."""
BLOCK_SAMPLES = 5
"""Fewer readings have no useful variance: slow logs get longer blocks."""
WINDOW_BLOCKS = 5
"""Stillness is judged over five blocks (half a second): long enough to see a rotation of 1 °/s in gravity, and half of
the shortest pose."""

FINEST = 1e-7
"""Least LSB, as a part of a channel's span: no ADC has 23 bits, and in a simulated channel without noise or ADC any
change of the last digit would count as motion."""


@dataclass(frozen=True, eq=False)
class Channels:
    """Blocks of ``length`` samples, accelerometer axes first, then gyro axes.

    ``mean``, ``variance`` (m, c) in raw units; ``is_valid`` (m,) is false where readings are missing or time jumps;
    ``quantum`` (c,) is the LSB; ``is_gyroscope`` (c,). ``at_limit`` (m, c) is the share of accelerometer readings at a
    range limit: a static gyro is at none, and those of a stream are not known (its readings are not all seen at once).
    """

    length: int
    step_s: float
    mean: FloatArray
    variance: FloatArray
    is_valid: BoolArray
    quantum: FloatArray
    is_gyroscope: BoolArray
    at_limit: FloatArray

    @property
    def n_blocks(self) -> int:
        """Number of whole blocks."""
        return len(self.mean)

    @property
    def quantisation_variance(self) -> FloatArray:
        """(c,) rounding variance q²/12, the least variance of a reading."""
        return self.quantum**2 / 12.0

    def blocks(self, duration_s: float) -> int:
        """Number of blocks in a duration, at least one."""
        return max(1, round(duration_s / self.step_s))


class BlockSums:
    """Blocks of an evenly sampled log that comes in pieces of whole blocks: equal to :func:`split_into_blocks` of the
    whole log."""

    def __init__(self, recording: Recording) -> None:
        self.length = block_length(recording.rate_hz)
        self.rate_hz = recording.rate_hz
        self.is_gyroscope = [recording.accelerometer is None] if recording.gyroscope is None else [True]
        if recording.accelerometer is not None:
            self.is_gyroscope = [False, True] if recording.gyroscope is not None else [False]
        self.stride = probe_stride(recording.n_samples)
        self.n = 0
        self.parts: list[tuple[FloatArray, FloatArray, BoolArray]] = []
        self.probes: list[list[FloatArray]] = [[] for _ in self.is_gyroscope]

    def add(self, triads: list[FloatArray]) -> None:
        """Add the next rows, (k, 3) per sensor; k is a multiple of ``length`` except in the last piece."""
        self.parts.append(_blocks(triads, self.length))
        first = -self.n % self.stride
        for probe, triad in zip(self.probes, triads, strict=True):
            probe.append(triad[first :: self.stride].copy())
        self.n += len(triads[0])

    def channels(self, steps: FloatArray | None = None) -> Channels:
        """All blocks so far; ``steps`` (c,) are the LSB where they are known."""
        mean, variance, is_valid = (np.concatenate([part[k] for part in self.parts]) for k in range(3))
        if steps is None:
            steps = np.concatenate([adc_steps(np.concatenate(probe)) for probe in self.probes])
        quantum = _not_below_arithmetic(steps, mean)
        gyroscope = np.repeat(self.is_gyroscope, 3)
        step_s, unknown = self.length / self.rate_hz, np.zeros(mean.shape)
        return Channels(self.length, step_s, mean, variance, is_valid, quantum, gyroscope, unknown)


def block_length(rate_hz: float) -> int:
    """Samples in a block."""
    return max(BLOCK_SAMPLES, round(BLOCK_S * rate_hz))


def _blocks(triads: list[FloatArray], length: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    parts = [_core.block_statistics(a, length) for a in triads]
    mean = np.hstack([p[0] for p in parts])
    variance = np.hstack([p[1] for p in parts])
    # A block is valid if more than half of its readings are present.
    is_valid = np.logical_and.reduce([2 * p[2] > length for p in parts]) & np.isfinite(variance).all(axis=1)
    return mean, variance, is_valid


def split_into_blocks(recording: Recording) -> Channels:
    """Block means and variances of every channel."""
    blocks = BlockSums(recording)
    blocks.add([a for a in (recording.accelerometer, recording.gyroscope) if a is not None])
    whole = blocks.channels(recording.facts.steps)
    is_valid, length = whole.is_valid, whole.length
    if len(is_valid):
        gap = np.diff(recording.time_s, prepend=recording.time_s[0]) > whole.step_s
        is_valid &= ~gap[: len(is_valid) * length].reshape(-1, length).any(axis=1)
    return replace(whole, at_limit=_at_limits(recording, whole.mean, length))


def _at_limits(recording: Recording, mean: FloatArray, length: int) -> FloatArray:
    """(m, c) share of readings at a range limit of the accelerometer, if its noise dithers the ADC: otherwise a pose
    keeps the outermost code without any range ending there."""
    out, facts = np.zeros(mean.shape), recording.facts.accelerometer
    if facts is not None and facts.limits and not undithered_axes(facts.step, facts.noise.max(keepdims=True)).any():
        at = facts.at_limits(recording.n_samples)[: len(mean) * length]
        out[:, :3] = at.reshape(len(mean), length, 3).mean(axis=1)
    return out


def _not_below_arithmetic(step: FloatArray, mean: FloatArray) -> FloatArray:
    present = mean[np.isfinite(mean).all(axis=1)]
    return np.maximum(step, FINEST * np.ptp(present, axis=0)) if len(present) else step


def mean_present(rows: FloatArray) -> FloatArray:
    """(c,) mean of rows (k, c) without missing values, which are searched only if the mean is not a number."""
    mean: FloatArray = rows.mean(axis=0)
    return np.nanmean(rows, axis=0) if np.isnan(mean).any() else mean


def rolling_mean(values: FloatArray, width: int) -> FloatArray:
    """(m, c) mean over ``width`` blocks centred on each; at the ends the nearest whole window."""
    return _core.rolling_mean(values, width)
