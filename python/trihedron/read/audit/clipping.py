"""Clipping: extreme values that the signal runs into and stays at. Found from the data, never from a nominal range."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.read.audit.repeats import CHUNK
from trihedron.read.table import FloatArray
from trihedron.records import Finding, FindingCode

Place = Callable[[int], str]
AXES = "xyz"
STEEP = 5.0
"""The wall is reached by steps this many times the noise: a quiet sensor resting on its largest count is no wall."""
FLAT = 6
"""So many equal readings in a row at the wall do the same for a sensor whose noise is above its resolution."""
PILED = 3.0
"""And it holds this many times more samples than the neighbouring values lead up to."""


@dataclass(frozen=True)
class Wall:
    """One axis' extreme value: ``count`` samples in ``stretches``, the first steep one at ``sample``."""

    axis: int
    value: float
    is_high: bool
    count: int
    stretches: int
    sample: int


def find_walls(readings: FloatArray, noise: FloatArray) -> list[Wall]:
    """Walls of a triad (n, 3) with ``noise`` (3,) of one sample at rest."""
    walls = []
    for axis in range(3):
        values = readings[:, axis]
        low, high = float(np.fmin.reduce(values)), float(np.fmax.reduce(values))
        if not low < high:
            continue
        for value in (high, low):
            wall = _wall(values, value, 0.01 * (high - low), float(noise[axis]))
            if wall is not None:
                count, stretches, sample = wall
                walls.append(Wall(axis, value, value == high, count, stretches, sample))
    return walls


def _wall(values: FloatArray, value: float, depth: float, noise: float) -> tuple[int, int, int] | None:
    at = np.flatnonzero(values == value)
    if len(at) < 3:
        return None
    near, width = -len(at), math.inf
    for start in range(0, len(values), CHUNK):
        distance = np.abs(values[start : start + CHUNK] - value)
        near += int(np.count_nonzero(distance <= depth))
        width = min(width, float(np.min(distance, where=distance > 0, initial=math.inf)))
    # Towards the top of a smooth peak the density grows as one over the root of the distance, so the share of the
    # topmost level among all within `depth` is the root of its width.
    by_shape = near * min(math.sqrt(width / depth), 1.0)
    starts, lengths = _runs(at)
    before = np.abs(values[np.maximum(starts - 1, 0)] - value)
    after = np.abs(values[np.minimum(starts + lengths, len(values) - 1)] - value)
    steep = (lengths >= 2) & (np.fmax(before, after) > STEEP * max(noise, width))
    if noise > quantum(values):
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


def quantum(values: FloatArray) -> float:
    """Step between neighbouring possible readings; zero where the values do not repeat, as those of a fine sensor."""
    probe = values[:: max(1, len(values) // 200_000)]
    levels = np.unique(probe[np.isfinite(probe)])
    if len(levels) < 2 or len(levels) > 0.2 * len(probe):
        return 0.0
    # Decimals as written may differ in the last digit for one and the same code: the tenth percentile passes over that.
    step: np.float64 = np.percentile(np.diff(levels), 10.0)
    return float(step)


def _runs(at: npt.NDArray[np.intp]) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """(start, length) of runs of consecutive indices."""
    breaks = np.flatnonzero(np.diff(at) > 1)
    starts = np.concatenate([at[:1], at[breaks + 1]])
    ends = np.concatenate([at[breaks], at[-1:]])
    return starts, ends - starts + 1


def short(sensor: str) -> str:
    """The sensor's name in a sentence."""
    return "gyro" if sensor == "gyroscope" else sensor


def audit_clipping(sensor: str, walls: list[Wall], place: Place) -> list[Finding]:
    """One finding per sensor that names every wall."""
    if not walls:
        return []
    first = min(w.sample for w in walls)
    numbers = {f"{AXES[w.axis]}_{'high' if w.is_high else 'low'}_count": float(w.count) for w in walls}
    numbers |= {f"{AXES[w.axis]}_{'high' if w.is_high else 'low'}_value": w.value for w in walls}
    return [
        Finding.of(
            FindingCode.CLIPPING,
            sensor=short(sensor),
            walls=[(AXES[w.axis], w.value, w.count, w.stretches) for w in walls],
            where=place(first),
            count=sum(w.count for w in walls),
            sample=first,
            numbers=numbers,
        )
    ]
