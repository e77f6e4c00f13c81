"""Properties of the ADCs behind a log, measured from its readings: resolution, noise, range limits, low-pass."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.errors import InputError
from trihedron.records.frozen import Frozen
from trihedron.records.pose_noise import Measured

SAME_STEP = 0.02
"""Relative difference within which the resolutions of three axes count as equal: text truncates digits."""


@dataclass(frozen=True, eq=False)
class Limit(Frozen):
    """Range limit of one channel: ``value`` in raw units and its standard error ``sigma``, 0 where readings show it
    exactly; ``runs`` (k, 2) of readings at the limit as half-open ranges of samples.
    ``is_word``: the value is the largest or smallest code of the ADC's word."""

    axis: int
    value: float
    is_high: bool
    runs: IntArray
    sigma: float = 0.0
    is_word: bool = False

    @property
    def count(self) -> int:
        """Readings at the limit."""
        return int(np.sum(self.runs[:, 1] - self.runs[:, 0]))


@dataclass(frozen=True)
class LowPass:
    """The low-pass filter ahead of a channel's samples.

    ``corner_hz`` if it is detected, else ``above_hz`` is its lower bound; ``shape``: its order, 0 for a Gaussian.
    """

    corner_hz: Measured | None
    above_hz: float
    shape: int = 0


@dataclass(frozen=True, eq=False)
class ChannelFacts(Frozen):
    """Properties of one sensor's three channels, raw units.

    ``step`` (3,) is the resolution (LSB), 0 where readings lie on no grid; ``noise`` (3,) the standard deviation of one
    sample in the quietest half seconds of the log, 0 where it has none; ``limits`` at which readings were clipped.
    """

    step: FloatArray
    noise: FloatArray
    limits: tuple[Limit, ...]

    def at_limits(self, n: int) -> BoolArray:
        """(n, 3) True for readings at a range limit; n is the number of samples."""
        out = np.zeros((n, 3), dtype=np.bool_)
        for limit in self.limits:
            for first, stop in limit.runs.tolist():
                out[first:stop, limit.axis] = True
        return out

    def moved(self, to: IntArray) -> ChannelFacts:
        """The same for a log with samples inserted: ``to`` (n,) are the new indices of its own samples."""
        limits = tuple(
            replace(limit, runs=np.stack([to[limit.runs[:, 0]], to[limit.runs[:, 1] - 1] + 1], axis=1))
            for limit in self.limits
        )
        return replace(self, limits=limits)

    @property
    def common_step(self) -> float:
        """The resolution that all three channels share, 0 where they differ."""
        step = float(np.median(self.step))
        return step if bool(np.all(np.abs(self.step - step) <= SAME_STEP * step)) else 0.0


@dataclass(frozen=True, eq=False)
class RecordingFacts(Frozen):
    """The channel properties of both sensors; ``None`` for a sensor that the recording lacks."""

    accelerometer: ChannelFacts | None
    gyroscope: ChannelFacts | None

    @property
    def steps(self) -> FloatArray:
        """(3,) or (6,) resolutions of all channels present, the accelerometer's first."""
        return np.concatenate([one.step for one in (self.accelerometer, self.gyroscope) if one is not None])

    def moved(self, to: IntArray) -> RecordingFacts:
        """The same for a log with samples inserted (:meth:`ChannelFacts.moved`)."""
        return RecordingFacts(*(one and one.moved(to) for one in (self.accelerometer, self.gyroscope)))

    def of(self, sensor: str) -> ChannelFacts:
        """The channel properties of one sensor. Raises ``InputError`` when the recording lacks that sensor."""
        facts = {"accelerometer": self.accelerometer, "gyroscope": self.gyroscope}[sensor]
        if facts is None:
            raise InputError(f"the recording has no {sensor}")
        return facts
