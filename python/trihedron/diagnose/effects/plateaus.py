"""Readings at the range limits of a recording, inside its moves."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from trihedron.arrays import BoolArray
from trihedron.diagnose.session.observations import Observations
from trihedron.records.channel_facts import Limit

HALF_WINDOW = 6
"""Samples on either side of an interval that determine the local motion."""


@dataclass(frozen=True)
class Plateau:
    """One run at a limit inside a move: samples ``[start, stop)``.

    ``is_rail``: every sample is the limit's code, which alone proves clipping; otherwise the run is level within noise.
    """

    limit: Limit
    start: int
    stop: int
    is_rail: bool

    @property
    def axis(self) -> int:
        """Axis of its channel."""
        return self.limit.axis

    @property
    def sign(self) -> int:
        """+1 at the upper limit, -1 at the lower."""
        return 1 if self.limit.is_high else -1


@lru_cache(maxsize=16)
def plateaus_of(obs: Observations, *, is_gyro: bool) -> list[Plateau]:
    """Runs at the limits of one sensor inside the moves of ``obs``."""
    name = "gyroscope" if is_gyro else "accelerometer"
    if (obs.raw_rate if is_gyro else obs.raw_force) is None or not obs.move_ranges:
        return []
    exact, noisy = obs.recording.facts.of(name).limits, obs.recording.possible_limits[name]
    starts, stops = np.array(obs.move_ranges, dtype=np.int64).T
    found = []
    for limit in (*exact, *noisy):
        for first, last in limit.runs.tolist():
            for move in np.flatnonzero((starts < last) & (stops > first)).tolist():
                ends = max(first, int(starts[move])), min(last, int(stops[move]))
                found.append(Plateau(limit, *ends, limit in exact))
    return found


@lru_cache(maxsize=8)
def clipped_samples(obs: Observations) -> BoolArray:
    """(n,) samples within ``HALF_WINDOW`` of a plateau at a range limit: their steps give no time error."""
    mask = np.zeros(len(obs.time_s), dtype=bool)
    for is_gyro in (False, True):
        for run in plateaus_of(obs, is_gyro=is_gyro):
            mask[max(run.start - HALF_WINDOW, 0) : run.stop + HALF_WINDOW] = True
    return mask
