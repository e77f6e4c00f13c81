"""One end of a channel: its extreme value, the readings on it, and those that lead up to it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.quantiles import median

FLAT = 1.5
"""Steps that a channel at rest between two codes may go to and fro; hands and their tremor are far more."""
STILL = 8
"""Readings on an end from which it is asked whether all channels stood still: over fewer a slow motion does."""
ORDER, GAIN = 4, np.sqrt(70.0)
"""Differences of this order hold next to nothing of a motion, and so many standard deviations of white noise."""
WHITE = 0.2
"""Part of the noise at rest that they must show: filters leave as much; of a log that never rests it is the motion."""
PROBED = 1 << 14
"""Readings, in so many stretches evenly spread over the log, from which its scatter and its middle are taken."""
STRETCHES = 16
TO_SIGMA = 1.4826
"""Standard deviation of a Gaussian over the median of its size."""


@dataclass(frozen=True, eq=False)
class End:
    """The largest or smallest ``value`` of an axis of ``readings`` (n, 3), read ``count`` times.

    ``span`` is the distance of the axis' two ends, ``noise`` that of one sample at rest, ``steps`` (3,) ADCs'.
    """

    readings: FloatArray
    axis: int
    value: float
    is_high: bool
    count: int
    span: float
    noise: float
    steps: FloatArray

    @property
    def step(self) -> float:
        """The step of this axis' ADC; too few codes show none, then its neighbours'."""
        return float(self.steps[self.axis] or np.max(self.steps))

    @property
    def column(self) -> FloatArray:
        """(n,) readings of the axis."""
        return self.readings[:, self.axis]

    def near(self, depth: float) -> tuple[int, float]:
        """How many other readings lie within ``depth`` of the end, and how far away the nearest is."""
        within, width, at = _core.readings_near(self.readings, self.axis, self.value, depth)
        return within - len(at), width

    @cached_property
    def runs(self) -> IntArray:
        """(k, 2) first sample of every run of readings on the end, and the one behind its last."""
        at: npt.NDArray[np.int64] = _core.readings_near(self.readings, self.axis, self.value, 0.0)[2]
        breaks = np.flatnonzero(np.diff(at) > 1)
        return np.stack([np.concatenate([at[:1], at[breaks + 1]]), np.concatenate([at[breaks], at[-1:]]) + 1], axis=1)

    @cached_property
    def stretches(self) -> list[FloatArray]:
        """Parts of the column, evenly spread over a long log, that stand for it."""
        column, length = self.column, PROBED // STRETCHES
        if len(column) <= PROBED:
            return [column]
        starts = np.linspace(0, len(column) - length, STRETCHES).astype(int)
        return [column[first : first + length] for first in starts]

    @property
    def middle(self) -> float:
        """Where the axis mostly is."""
        seen = np.concatenate(self.stretches)
        seen = seen[np.isfinite(seen)]
        return median(seen) if len(seen) else float(np.nanmedian(self.column))

    @cached_property
    def dither(self) -> float:
        """Noise of one sample that carries readings from code to code, 0 where what looks like noise may be motion."""
        rough = np.abs(np.concatenate([np.diff(part, ORDER) for part in self.stretches]))
        rough = rough[np.isfinite(rough)]
        seen = TO_SIGMA * median(rough) / GAIN if len(rough) else 0.0
        return min(seen, self.noise) if seen > WHITE * self.noise else 0.0

    @property
    def lasts(self) -> bool:
        """Whether neighbouring samples lie on it."""
        return self.count > 1 and bool(np.max(np.diff(self.runs, axis=1)) > 1)

    @cached_property
    def moving_runs(self) -> IntArray:
        """The runs (k, 2) without those in which every channel stands still: they are poses, or steady turns.

        An ADC coarser than the noise shows either as one code, whatever it is. Whoever drives a sensor beyond its
        limit moves the other axes meanwhile, and noise that moves their last digit is no standstill.
        """
        others = [k for k in range(3) if k != self.axis]
        keep = np.ones(len(self.runs), dtype=np.bool_)
        for k in np.flatnonzero(np.diff(self.runs, axis=1)[:, 0] >= STILL).tolist():
            first, stop = self.runs[k].tolist()
            keep[k] = not self._stands_still(first, stop, others)
        return self.runs[keep]

    def _stands_still(self, first: int, stop: int, others: list[int]) -> bool:
        # The motion sets in and ends while the axis is at its extreme code already, or still.
        edge = max((stop - first) // 6, 1)
        part = self.readings[first + edge : stop - edge, others]
        return bool(np.all(np.ptp(part, axis=0) < FLAT * float(np.max(self.steps))))
