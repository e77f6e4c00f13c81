"""Limits of a converter or a sensor: extreme values that readings run into and stay at, never a nominal range."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.records.channel_facts import Limit

STEEP = 5.0
"""The wall is reached by steps this many times the noise: a quiet sensor resting on its largest count is no wall."""
FLAT = 6
"""So many equal readings in a row at the wall do the same for a sensor whose noise is above its resolution."""
FEWEST = 8
"""Readings from which an end is told."""
PILED = 3.0
"""And it holds this many times more samples than the neighbouring values lead up to."""


def find_limits(readings: FloatArray, noise: FloatArray, step: FloatArray) -> tuple[Limit, ...]:
    """Limits of a triad (n, 3) with ``noise`` (3,) of one sample at rest and ``step`` (3,) of the converter."""
    found: list[Limit] = []
    if len(readings) < FEWEST:
        return ()
    for axis, (low, n_low, high, n_high) in enumerate(_core.triad_extremes(readings)):
        if not low < high or math.isinf(low) or math.isinf(high):
            continue
        for value, count in ((high, n_high), (low, n_low)):
            is_fine = bool(noise[axis] > step[axis])
            wall = _wall(readings, axis, value, 0.01 * (high - low), float(noise[axis]), is_fine) if count > 2 else None
            if wall is not None:
                count, stretches, sample = wall
                found.append(Limit(axis, value, value == high, count, stretches, sample))
    return tuple(found)


def _wall(
    readings: FloatArray, axis: int, value: float, depth: float, noise: float, is_fine: bool
) -> tuple[int, int, int] | None:
    within, width, at = _core.readings_near(readings, axis, value, depth)
    values, near = readings[:, axis], within - len(at)
    # Towards the top of a smooth peak the density grows as one over the root of the distance, so the share of the
    # topmost level among all within `depth` is the root of its width.
    by_shape = near * min(math.sqrt(width / depth), 1.0)
    starts, lengths = _runs(at)
    before = np.abs(values[np.maximum(starts - 1, 0)] - value)
    after = np.abs(values[np.minimum(starts + lengths, len(values) - 1)] - value)
    steep = (lengths >= 2) & (np.fmax(before, after) > STEEP * max(noise, width))
    if is_fine:
        # Noise that moves the last digit never leaves one value alone for so long, however slowly the wall is reached.
        steep |= lengths >= FLAT
    # One stretch alone may be a channel that froze; at the end of an integer's range it is the range.
    enough = 1 if _is_full_scale(value) else 2
    if np.count_nonzero(steep) < enough or len(at) <= PILED * by_shape:
        return None
    return len(at), len(starts), int(starts[np.argmax(steep)])


def _is_full_scale(value: float) -> bool:
    """A code at the end of a converter's range: 2^k - 1, or -2^k, k from 7."""
    if value != round(value) or abs(value) < 127:
        return False
    magnitude = int(value) + 1 if value > 0 else -int(value)
    return magnitude & (magnitude - 1) == 0


def _runs(at: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """(start, length) of runs of consecutive indices."""
    breaks = np.flatnonzero(np.diff(at) > 1)
    starts = np.concatenate([at[:1], at[breaks + 1]])
    ends = np.concatenate([at[breaks], at[-1:]])
    return starts, ends - starts + 1
