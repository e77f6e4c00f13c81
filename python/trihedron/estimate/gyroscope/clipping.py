"""Readings at the gyro's limit: found, bridged by a smooth peak, and made as uncertain as that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray

LONGEST_BRIDGE_S = 0.15
"""A hand turns smoothly over this long; a peak cut for longer may have had any shape."""

DOUBT = 0.5
"""Standard error of the bridged area above the limit, as a part of that area."""


NOISE_JUMP = 5.0
"""Standard deviations of a reading that noise alone may jump at the two ends of a peak's top, in all peaks of a log."""


@dataclass(frozen=True, eq=False)
class Clipped:
    """``is_clipped`` (n, 3), ``readings`` (n, 3) with the peaks bridged, ``variance`` (n, 3) of each bridged
    reading."""

    is_clipped: BoolArray
    readings: FloatArray
    variance: FloatArray


def bridge_clipping(time_s: FloatArray, gyroscope: FloatArray) -> Clipped | None:
    """Replace runs at the limit by the cubic that continues the slopes on both sides; ``None`` when there are none.

    The limit of an axis is its extreme value if neighbouring samples share it, far from where the gyro rests, and the
    readings jump to it or from it further than a smooth peak inside one step of the converter would
    (:func:`_is_cut`). A cubic with slopes ``s₁, s₂`` at the ends of a run of length ``T``
    has the area ``T² (s₁ − s₂)/12`` above the chord; half of it is taken for its standard error.
    """
    is_clipped = np.zeros(gyroscope.shape, dtype=bool)
    for axis in range(3):
        column = gyroscope[:, axis]
        finite = np.isfinite(column)
        if not np.any(finite):
            continue
        rest, span = float(np.median(column[finite])), float(np.ptp(column[finite]))
        for limit in (float(np.max(column[finite])), float(np.min(column[finite]))):
            at = column == limit
            if abs(limit - rest) > 0.3 * span and _is_cut(column, at):
                is_clipped[:, axis] |= at
    if not np.any(is_clipped):
        return None
    readings, variance = gyroscope.copy(), np.zeros(gyroscope.shape)
    for axis in range(3):
        for first, last in _runs(is_clipped[:, axis]):
            _bridge(time_s, readings[:, axis], variance[:, axis], first, last)
    return Clipped(is_clipped, readings, variance)


def _is_cut(column: FloatArray, at: BoolArray) -> bool:
    """Some run at the extreme is no smooth peak that happens to share a code.

    A parabola of which n samples stay within a step q has a curvature of at most 8 q/(n − 1)², and one sample further
    it has fallen by at most 4 q n/(n − 1)² more; rounding may add a step, and noise its own jumps.
    """
    finite = column[np.isfinite(column)]
    gaps = np.diff(_core.levels_of(column)[0])
    if not len(gaps):
        return False
    quantum = float(np.median(gaps[gaps <= 1.5 * np.quantile(gaps, 0.25)]))
    noise = 1.4826 * float(np.median(np.abs(np.diff(finite)))) / np.sqrt(2.0)
    for first, last in _runs(at):
        count = last - first + 1
        if count < 2:
            continue
        smooth = quantum * (1.0 + 4.0 * count / (count - 1) ** 2) + NOISE_JUMP * noise
        ends = [column[k] for k in (first - 1, last + 1) if 0 <= k < len(column) and np.isfinite(column[k])]
        if ends and max(abs(value - column[first]) for value in ends) > smooth:
            return True
    return False


def clipped_time(clipped: Clipped | None, edges: IntArray, step_s: float) -> FloatArray:
    """Time (m,) that each move spent at the limit on any axis, s."""
    if clipped is None:
        return np.zeros(len(edges))
    any_axis = np.any(clipped.is_clipped, axis=1)
    return np.array([step_s * float(np.count_nonzero(any_axis[a:b])) for a, b in edges])


def _runs(mask: BoolArray) -> list[tuple[int, int]]:
    change = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(change[::2], change[1::2], strict=True)]


def _bridge(time_s: FloatArray, column: FloatArray, variance: FloatArray, first: int, last: int) -> None:
    left, right = first - 1, last + 1
    if left < 1 or right > len(column) - 2:
        return
    span = time_s[right] - time_s[left]
    before, after = time_s[left] - time_s[left - 1], time_s[right + 1] - time_s[right]
    if span <= 0.0 or before <= 0.0 or after <= 0.0:
        return
    enter = (column[left] - column[left - 1]) / before
    leave = (column[right + 1] - column[right]) / after
    u = (time_s[first : last + 1] - time_s[left]) / span
    column_left, column_right = column[left], column[right]
    column[first : last + 1] = (
        (2 * u**3 - 3 * u**2 + 1) * column_left
        + (u**3 - 2 * u**2 + u) * span * enter
        + (3 * u**2 - 2 * u**3) * column_right
        + (u**3 - u**2) * span * leave
    )
    area = span**2 * abs(enter - leave) / 12.0
    count = last - first + 1
    # Spread over the samples of the run so that their sum, taken as independent, has the variance of the area.
    variance[first : last + 1] = (DOUBT * area) ** 2 / count / (span / (count + 1)) ** 2
