"""Readings at the gyro's limit: found, bridged by a smooth peak, and made as uncertain as that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.ranges import Range, edges_of, ranges_of

LONGEST_BRIDGE_S = 0.15
"""A hand turns smoothly over this long; a peak cut for longer may have had any shape."""

DOUBT = 0.5
"""Standard error of the bridged area above the limit, as a part of that area."""


FAR = 0.3
"""Part of an axis' span that lies between a limit and where the gyro rests."""
FEWEST_CODES = 100.0
"""From so many steps on, two axes that end at one code, or one that ends at a power of two, do so hardly by chance."""
TOP = 3.0
"""Sharper by this much than that parabola falls a peak upon which a tremor rides."""
FLAT = 1.5
"""Steps that an axis at rest between two codes may go to and fro; a hand's tremor is several degrees per second."""
PAIR_BEND = 8.0
"""Bend, in steps, that two equal samples are allowed: more is no evidence by itself."""
NOISE_JUMP = 5.0
"""Standard deviations of a reading that noise alone may jump at the two ends of a peak's top, in all peaks of a log."""


@dataclass(frozen=True, eq=False)
class Clipped:
    """``is_clipped`` (n, 3), ``readings`` (n, 3) with the peaks bridged, ``variance`` (n, 3) of each bridged
    reading."""

    is_clipped: BoolArray
    readings: FloatArray
    variance: FloatArray


def bridge_clipping(time_s: FloatArray, gyroscope: FloatArray, step: FloatArray) -> Clipped | None:
    """Replace runs at the limit by the cubic that continues the slopes on both sides; ``None`` when there are none.

    The limit of an axis is its extreme value if neighbouring samples share it, far from where the gyro rests, and the
    readings jump to it or from it further than a smooth peak inside one ``step`` (3,) of the converter would
    (:func:`_is_cut`). A cubic with slopes ``s₁, s₂`` at the ends of a run of length ``T``
    has the area ``T² (s₁ − s₂)/12`` above the chord; half of it is taken for its standard error.
    """
    is_clipped = np.zeros(gyroscope.shape, dtype=bool)
    largest, smallest, middle, step_size = _core.channel_extents(gyroscope).T
    extremes = np.concatenate([largest, smallest])
    lasting = [j for j, end in enumerate(extremes) if _longest(gyroscope[:, j % 3] == end) > 1]
    for k, limit in enumerate(extremes):
        column = gyroscope[:, k % 3]
        if not np.isfinite(limit):
            continue
        far = abs(limit - float(middle[k % 3]))
        quantum = float(step[k % 3])
        if far <= FAR * np.ptp(extremes[[k % 3, k % 3 + 3]]):
            continue
        at = column == limit
        is_known = _is_end_of_codes(limit, np.array([extremes[j] for j in lasting if j != k]), quantum)
        runs = ranges_of(at)
        if not is_known:
            runs = _without_steady_turns(time_s, gyroscope, runs, k % 3, step, float(step_size[k % 3]))
        if _is_cut(column, runs, quantum, is_known, float(step_size[k % 3])):
            is_clipped[:, k % 3] |= at
    if not np.any(is_clipped):
        return None
    readings, variance = gyroscope.copy(), np.zeros(gyroscope.shape)
    for axis in range(3):
        for first, stop in ranges_of(is_clipped[:, axis]):
            _bridge(time_s, readings[:, axis], variance[:, axis], first, stop - 1)
    return Clipped(is_clipped, readings, variance)


def _without_steady_turns(
    time_s: FloatArray, gyroscope: FloatArray, runs: list[Range], axis: int, step: FloatArray, step_size: float
) -> list[Range]:
    """The runs of an axis without those in which the other axes stand still as well.

    A converter coarser than the noise shows a table's steady turn as one code: the wall and the turn look alike on the
    axis, but whoever turns a gyro by hand beyond its limit moves the other axes meanwhile. ``step_size`` is the middle
    size of the axis' steps from reading to reading.
    """
    if step_size > 0.0:
        return runs  # noise moves the last digit: a turn that is not at a wall would show it
    others = [k for k in range(3) if k != axis]
    out = []
    for first, stop in runs:
        # The turn sets in and ends while the axis is at its extreme code already, or still.
        edge = max((stop - first) // 6, 1)
        part = gyroscope[first + edge : stop - edge][:, others]
        is_long = len(part) > 2 and float(time_s[stop - 1] - time_s[first]) > LONGEST_BRIDGE_S
        if is_long and np.all(np.ptp(part, axis=0) < FLAT * step[others]):
            continue
        out.append((first, stop))
    return out


def _is_cut(column: FloatArray, runs: list[Range], quantum: float, is_known: bool, step_size: float) -> bool:
    """Some of ``runs`` at the extreme is no smooth peak, and no steady turn, that happens to share a code.

    A parabola of which n samples stay within a step q has a curvature of at most 8 q/((n − 1)² − 1), n even, or
    8 q/(n − 1)², n odd. One sample further it has fallen by half of that times n, two further by that times n + 1;
    a tremor makes it steeper (``TOP``), rounding may add a step, and noise its own jumps. The readings fall by more at
    *both* ends of a run that was cut: a turn at a steady rate begins and ends steeply and meanwhile wavers about its
    extreme. Two equal samples may lie on either side of any peak: they are the limit's only where it is ``is_known``
    otherwise, or two peaks end at it.
    """
    noise = 1.4826 * step_size / np.sqrt(2.0)
    pairs = 0
    for first, stop in runs:
        last, count = stop - 1, stop - first
        if count < 2:
            continue
        bend = TOP * 8.0 / ((count - 1) ** 2 - (1 - count % 2)) if count > 2 else PAIR_BEND
        smooth = quantum * (1.0 + bend * np.array([0.5 * count, count + 1.0])) + NOISE_JUMP * noise
        if all(
            np.any(np.abs(side - column[first]) > smooth[: len(side)])
            for side in (column[last + 1 : last + 3], column[max(first - 2, 0) : first][::-1])
            if np.isfinite(side).any()
        ):
            if count > 2 or is_known:
                return True
            pairs += 1
    return pairs > 1


def _is_end_of_codes(limit: float, others: FloatArray, quantum: float) -> bool:
    """Whether an extreme looks like a limit by its value: the end of a word of bits, or where another axis ends."""
    if quantum <= 0.0:
        return bool(np.any(np.abs(others) == abs(limit)))
    code = abs(limit) / quantum
    if code < FEWEST_CODES:
        return False
    is_word = quantum == 1.0 and any(end > 0 and end & (end - 1) == 0 for end in (int(code), int(code) + (limit > 0)))
    # Both ends of a word are a step apart; ends on one side are the same.
    apart = np.where(others * limit > 0.0, 0.1, 1.1) * quantum
    return is_word or bool(np.any(np.abs(np.abs(others) - abs(limit)) < apart))


def clipped_time(clipped: Clipped | None, edges: IntArray, step_s: float) -> FloatArray:
    """Time (m,) that each move spent at the limit on any axis, s."""
    if clipped is None:
        return np.zeros(len(edges))
    any_axis = np.any(clipped.is_clipped, axis=1)
    return np.array([step_s * float(np.count_nonzero(any_axis[a:b])) for a, b in edges])


def _longest(mask: BoolArray) -> int:
    return int(np.diff(edges_of(mask), axis=1).max(initial=0))


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
