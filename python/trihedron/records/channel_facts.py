"""What a log's readings say of the converters that wrote them, measured once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.records.frozen import Frozen

SAME_STEP = 0.02
"""Part by which one step of three converters may be measured differently where text has cut its digits."""


@dataclass(frozen=True)
class Limit:
    """One channel's extreme value, if it is where readings end: ``count`` samples in ``stretches``, the first steep one
    at ``sample``."""

    axis: int
    value: float
    is_high: bool
    count: int
    stretches: int
    sample: int


@dataclass(frozen=True, eq=False)
class ChannelFacts(Frozen):
    """One sensor's three channels, raw units.

    ``step`` (3,) of the converter, 0 where readings lie on no grid; ``noise`` (3,) of one sample in the quietest half
    seconds of the log, 0 where it has none; ``limits`` that readings were cut off at.
    """

    step: FloatArray
    noise: FloatArray
    limits: tuple[Limit, ...]

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
        out: FloatArray = np.concatenate([one.step for one in (self.accelerometer, self.gyroscope) if one is not None])
        return out

    def of(self, sensor: str) -> ChannelFacts:
        """The facts of one sensor.

        Raises
        ------
        ValueError
            When the recording has it not.
        """
        facts = {"accelerometer": self.accelerometer, "gyroscope": self.gyroscope}[sensor]
        if facts is None:
            raise ValueError(f"the recording has no {sensor}")
        return facts
