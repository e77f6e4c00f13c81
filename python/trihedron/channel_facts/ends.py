"""One extreme of a channel: its value, the readings equal to it, and those next to it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.quantiles import median

FLAT = 1.5
"""Peak-to-peak, in LSB, of a static channel between two codes; hand motion and tremor are far larger."""
STILL = 8
"""Readings on an extreme from which all channels are tested for standstill: slow motion takes fewer."""
ORDER, GAIN = 4, np.sqrt(70.0)
"""Order of differences that remove motion, and their standard deviation for white noise of 1."""
WHITE = 0.2
"""Least share of the static noise that they must show: filters leave as much; less indicates a noise that is motion."""
PROBED = 1 << 14
"""Readings, in ``STRETCHES`` parts evenly spread over the log, that give its scatter and its median."""
STRETCHES = 16
TO_SIGMA = 1.4826
"""Standard deviation of a Gaussian over its median absolute deviation."""


@dataclass(frozen=True, eq=False)
class End:
    """The largest or smallest ``value`` of an axis of ``readings`` (n, 3), read ``count`` times.

    ``span`` is the range of the axis, ``noise`` that of one static sample, ``steps`` (3,) the LSB of the axes.
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
        """LSB of this axis; with too few codes to show one, the largest of the others."""
        return float(self.steps[self.axis] or np.max(self.steps))

    @property
    def column(self) -> FloatArray:
        """(n,) readings of the axis."""
        return self.readings[:, self.axis]

    def near(self, depth: float) -> int:
        """Number of other readings within ``depth`` of the extreme."""
        within, _, at = _core.readings_near(self.readings, self.axis, self.value, depth)
        return within - len(at)

    @cached_property
    def runs(self) -> IntArray:
        """(k, 2) first sample of every run of readings on the extreme, and one past its last."""
        at: IntArray = _core.readings_near(self.readings, self.axis, self.value, 0.0)[2]
        breaks = np.flatnonzero(np.diff(at) > 1)
        return np.stack([np.concatenate([at[:1], at[breaks + 1]]), np.concatenate([at[breaks], at[-1:]]) + 1], axis=1)

    @cached_property
    def stretches(self) -> list[FloatArray]:
        """Parts of the column, evenly spread, that represent a long log."""
        column, length = self.column, PROBED // STRETCHES
        if len(column) <= PROBED:
            return [column]
        starts = np.linspace(0, len(column) - length, STRETCHES).astype(int)
        return [column[first : first + length] for first in starts]

    @property
    def middle(self) -> float:
        """Median of the axis."""
        seen = np.concatenate(self.stretches)
        seen = seen[np.isfinite(seen)]
        return median(seen) if len(seen) else float(np.nanmedian(self.column))

    @cached_property
    def dither(self) -> float:
        """Noise of one sample that dithers the LSB, 0 where it may be motion."""
        rough = np.abs(np.concatenate([np.diff(part, ORDER) for part in self.stretches]))
        rough = rough[np.isfinite(rough)]
        seen = TO_SIGMA * median(rough) / GAIN if len(rough) else 0.0
        return min(seen, self.noise) if seen > WHITE * self.noise else 0.0

    @property
    def lasts(self) -> bool:
        """Whether neighbouring samples have the extreme value."""
        return self.count > 1 and bool(np.max(np.diff(self.runs, axis=1)) > 1)

    @cached_property
    def moving_runs(self) -> IntArray:
        """The runs (k, 2) without those in which every channel stands still: these are poses, or constant rates.

        An ADC coarser than the noise shows both as one code of any value. Motion beyond a sensor's range moves the
        other axes too, and noise that moves their last digit is no standstill.
        """
        others = [k for k in range(3) if k != self.axis]
        keep = np.ones(len(self.runs), dtype=np.bool_)
        for k in np.flatnonzero(np.diff(self.runs, axis=1)[:, 0] >= STILL).tolist():
            first, stop = self.runs[k].tolist()
            keep[k] = not self._stands_still(first, stop, others)
        return self.runs[keep]

    def _stands_still(self, first: int, stop: int, others: list[int]) -> bool:
        # Without its edges: the motion begins and ends while the axis is at its extreme code.
        edge = max((stop - first) // 6, 1)
        part = self.readings[first + edge : stop - edge, others]
        return bool(np.all(np.ptp(part, axis=0) < FLAT * float(np.max(self.steps))))
