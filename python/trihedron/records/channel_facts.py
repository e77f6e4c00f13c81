"""Properties of the ADCs behind a log, measured from its readings: resolution, noise, range limits, low-pass."""

from __future__ import annotations

from dataclasses import dataclass

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

    def bridged(
        self, time_s: FloatArray, readings: FloatArray, first: int, stop: int
    ) -> tuple[FloatArray, float] | None:
        """A run of the readings (n, 3) on the cubic that continues the slopes on both sides, and its area beyond the
        chord: ``T² (s₁ − s₂)/12`` with slopes ``s₁, s₂`` at the ends of a run of length ``T``; ``None`` at an end of
        the log."""
        t, column, left = time_s, readings[:, self.axis], first - 1
        if left < 1 or stop > len(column) - 2 or min(t[left] - t[left - 1], t[stop + 1] - t[stop]) <= 0.0:
            return None
        span = float(t[stop] - t[left])
        enter, leave = (float((column[k] - column[k - 1]) / (t[k] - t[k - 1])) for k in (left, stop + 1))
        # The Hermite cubic: SciPy has it, and takes longer to load than a calibration does.
        u = (t[first:stop] - t[left]) / span
        rises, falls = (u**3 - 2 * u**2 + u) * enter, (u**3 - u**2) * leave
        chord = column[left] + (3 * u**2 - 2 * u**3) * (column[stop] - column[left])
        return chord + span * (rises + falls), span**2 * abs(enter - leave) / 12.0


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

    def adc_range(self, readings: FloatArray) -> tuple[float, float] | None:
        """Lowest and highest code of one ADC behind all three channels of ``readings`` (n, 3).

        The side that no reading reached is symmetric to the other one, or open where readings lie beyond that.
        ``None`` without a limit, and where limits differ, are blurred by noise, or another channel reads beyond them:
        those are not of a common ADC.
        """
        if any(limit.sigma > 0.0 for limit in self.limits):
            return None
        step, least, most = float(self.step.max()), float(np.nanmin(readings)), float(np.nanmax(readings))
        lows, highs = ([one.value for one in self.limits if one.is_high is side] for side in (False, True))
        # Two's complement: the lowest code is one further from 0 than the highest.
        code = step if any(one.is_word for one in self.limits) else 0.0
        low, high = min(lows, default=-np.inf), max(highs, default=np.inf)
        if highs and not lows and -high - code <= least:
            low = -high - code
        if lows and not highs and -low - code >= most:
            high = -low - code
        is_common = max(lows, default=low) - least <= step and most - min(highs, default=high) <= step
        return (low, high) if self.limits and is_common else None

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

    def of(self, sensor: str) -> ChannelFacts:
        """The channel properties of one sensor. Raises ``InputError`` when the recording lacks that sensor."""
        facts = {"accelerometer": self.accelerometer, "gyroscope": self.gyroscope}[sensor]
        if facts is None:
            raise InputError(f"the recording has no {sensor}")
        return facts
