"""What a coarse ADC hides of known turns and of the bias: a steady rate inside a step is misread all along."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.session.rounding import CHATTER, undithered_axes

AT_REST = 0.75
"""Steps from the bias within which a reading at the ends of a turn is that of rest: a bias may toggle."""

Group = tuple[int, float, int]


@dataclass(frozen=True, eq=False)
class HiddenAngles:
    """Raw angles of ``turns`` (k, 3, m) and ``zeros`` (z, 3, m) by one standard error of each of m independent errors.

    ``passing`` (k, 3) is the variance by steps that a turn only passes through, where the errors run through all values
    and cancel but for one of them.
    """

    turns: FloatArray
    static: FloatArray
    passing: FloatArray

    def variance_of_turns(self) -> FloatArray:
        """(k, 3) raw²."""
        out: FloatArray = np.sum(self.turns**2, axis=2) + self.passing
        return out

    def variance_of_biases(self) -> FloatArray:
        """(z, 3) raw²."""
        out: FloatArray = np.sum(self.static**2, axis=2)
        return out


def hidden_angles(
    readings: FloatArray,
    step_s: float,
    quantum: FloatArray,
    turns: Sequence[tuple[int, int]],
    static: Sequence[tuple[int, int]],
    raw_angle: FloatArray,
) -> HiddenAngles | None:
    """What rounding to ``quantum`` (3,) hides of turns and zero turns; ``None`` where noise dithers every axis.

    A rate that stays inside a step is misread by the same part of it, uniform with q²/12, as long as it stays: for T
    seconds the angle is off by ``q T/√12``. Turns about one axis in one sense that read the same code may have run at
    one rate (a table's): they share the error, and so do all zero turns. Another code, the other sense, another axis
    have their own: with w' = z at rest and z ± mω across a turn there and back, all read alike, (z, mω) is uniform on
    ``|z| + |mω| < q/2``, where mω has the variance q²/24 that two independent errors give it.
    """
    still = np.concatenate([readings[a:b] for a, b in static])
    axes = _undithered(still, quantum)
    if not np.any(axes):
        return None
    rest = np.nanmedian(still, axis=0)
    groups: dict[Group, int] = {}
    entries: list[tuple[int, int, int, float]] = []
    passing = np.zeros((len(turns), 3))
    for axis in map(int, np.flatnonzero(axes)):
        size = float(quantum[axis]) / np.sqrt(12.0)
        for row, (a, b) in enumerate(turns):
            # Its sense and axis, by the raw reading that turned farthest.
            main = int(np.argmax(np.abs(raw_angle[row])))
            sense = (main + 1) * int(np.sign(raw_angle[row, main]))
            for first, last, level, is_passed in _dwells(readings[a:b, axis]):
                time = (last - first) * step_s
                if is_passed:
                    passing[row, axis] += (size * step_s) ** 2
                    continue
                is_end = (first == 0) != (last == b - a)
                at_rest = is_end and abs(level - rest[axis]) < AT_REST * quantum[axis]
                key = (axis, 0.0, 0) if at_rest else (axis, round(level / float(quantum[axis])), sense)
                entries.append((row, axis, groups.setdefault(key, len(groups)), size * time))
        for row, (a, b) in enumerate(static):
            key = (axis, 0.0, 0)
            entries.append((len(turns) + row, axis, groups.setdefault(key, len(groups)), size * (b - a) * step_s))
    out = np.zeros((len(turns) + len(static), 3, len(groups)))
    for row, axis, group, angle in entries:
        out[row, axis, group] += angle
    return HiddenAngles(out[: len(turns)], out[len(turns) :], passing)


def _undithered(still: FloatArray, quantum: FloatArray) -> BoolArray:
    """Axes (3,) whose noise at rest does not reach the step; what toggles between two codes does not show its noise."""
    white = np.sqrt(np.maximum(np.nanvar(still, axis=0) - quantum**2 / 12.0, 0.0))
    return undithered_axes(quantum, white)


def _dwells(readings: FloatArray) -> Iterator[tuple[int, int, float, bool]]:
    """Stretches of one code, freed of toggling: first, last, the reading, and whether the rate only passes through."""
    codes = _core.running_median(np.ascontiguousarray(np.where(np.isfinite(readings), readings, np.inf)), CHATTER)
    begins = np.concatenate([[0], np.flatnonzero(codes[1:] != codes[:-1]) + 1])
    ends = np.concatenate([begins[1:], [len(codes)]])
    level = codes[begins]
    with np.errstate(invalid="ignore"):
        sense = np.sign(np.diff(level))
    for k, (first, last) in enumerate(zip(begins, ends, strict=True)):
        is_passed = 0 < k < len(level) - 1 and sense[k - 1] * sense[k] > 0.0
        yield int(first), int(last), float(level[k]) if np.isfinite(level[k]) else 0.0, is_passed
