"""What a log's readings say of the ADCs that wrote them, measured once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.errors import RefusedError
from trihedron.records.frozen import Frozen
from trihedron.records.pose_noise import Measured

SAME_STEP = 0.02
"""Part by which one step of three ADCs may be measured differently where text has cut its digits."""


@dataclass(frozen=True, eq=False)
class Limit(Frozen):
    """One channel's end of range: ``value`` in raw units and its standard error ``sigma``, 0 where readings show it
    exactly; ``runs`` (k, 2) of readings that lie there, the first sample of each and the one behind its last.
    ``is_word``: the value is the code at the end of an ADC's word."""

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
    """The filter ahead of a channel's samples.

    ``corner_hz`` where one shows, what it lies ``above_hz`` where none does; ``shape``: its order, 0 a Gaussian.
    """

    corner_hz: Measured | None
    above_hz: float
    shape: int = 0


@dataclass(frozen=True, eq=False)
class ChannelFacts(Frozen):
    """One sensor's three channels, raw units.

    ``step`` (3,) of the ADC, 0 where readings lie on no grid; ``noise`` (3,) of one sample in the quietest half
    seconds of the log, 0 where it has none; ``limits`` that readings were cut off at.
    """

    step: FloatArray
    noise: FloatArray
    limits: tuple[Limit, ...]

    def at_limits(self, n: int) -> BoolArray:
        """(n, 3) which of the channel's n readings lie at a limit."""
        out = np.zeros((n, 3), dtype=np.bool_)
        for limit in self.limits:
            for first, stop in limit.runs.tolist():
                out[first:stop, limit.axis] = True
        return out

    def moved(self, to: IntArray) -> ChannelFacts:
        """The facts of a log into which samples were put: ``to`` (n,) are the places of its own among them."""
        limits = tuple(
            replace(limit, runs=np.stack([to[limit.runs[:, 0]], to[limit.runs[:, 1] - 1] + 1], axis=1))
            for limit in self.limits
        )
        return replace(self, limits=limits)

    @property
    def common_step(self) -> float:
        """The step of all three channels, 0 where they have not the same."""
        step = float(np.median(self.step))
        return step if bool(np.all(np.abs(self.step - step) <= SAME_STEP * step)) else 0.0


@dataclass(frozen=True, eq=False)
class RecordingFacts(Frozen):
    """The facts of both sensors; ``None`` for one that the recording has not."""

    accelerometer: ChannelFacts | None
    gyroscope: ChannelFacts | None

    @property
    def steps(self) -> FloatArray:
        """(3,) or (6,) steps of all channels that there are, the accelerometer's first."""
        return np.concatenate([one.step for one in (self.accelerometer, self.gyroscope) if one is not None])

    def moved(self, to: IntArray) -> RecordingFacts:
        """The facts of a log into which samples were put (:meth:`ChannelFacts.moved`)."""
        return RecordingFacts(*(one and one.moved(to) for one in (self.accelerometer, self.gyroscope)))

    def of(self, sensor: str) -> ChannelFacts:
        """The facts of one sensor.

        Raises
        ------
        ValueError
            When the recording has it not.
        """
        facts = {"accelerometer": self.accelerometer, "gyroscope": self.gyroscope}[sensor]
        if facts is None:
            raise RefusedError(f"the recording has no {sensor}")
        return facts
