"""Gravity that turns between two samples while the gyro rests: axes of both sensors that changed, or rows cut out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.read.clock.rate import usual_step
from trihedron.read.turning import Turning
from trihedron.records import Finding, FindingCode
from trihedron.records.words import Words

_LEAST_TURN = 0.35
"""Of gravity, 20 degrees: what no bias hides."""
_CALM = 0.1
"""Of gravity: how far readings of a side may lie from their mean, where a blow or a shake is none."""
_SEEN = 0.25
"""Of the turn: what the gyro may tell of it, between the middles of both sides, and still have missed it."""
_SIDE_S, _FEWEST = 0.1, 5
_SLOWEST_HZ = 20.0
"""A hand turns a part by 20 degrees in a twentieth of a second at most."""
_GAP_STEPS = 1.5
_BLOCK = 1 << 20


def audit_seam(
    time_s: FloatArray,
    accelerometer: FloatArray,
    gyroscope: FloatArray,
    turning: Turning,
    place: Callable[[int], Words],
) -> list[Finding]:
    """A finding where gravity leaps between two neighbours, the part at rest before and after.

    Parameters
    ----------
    time_s : array (n,) [s]
    accelerometer, gyroscope : array (n, 3), in any unit
    turning : Turning
        The scale at which the gyro turns gravity in the rest of the log.
    """
    step = usual_step(time_s[:_BLOCK])
    side = max(round(_SIDE_S / step), _FEWEST)
    if not 0.0 < step < 1.0 / _SLOWEST_HZ or len(time_s) < 4 * side:
        return []
    few = accelerometer[:: max(len(accelerometer) // 20_000, 1)]
    gravity = float(np.nanmedian(np.linalg.norm(few, axis=1)))
    rest = np.nanmedian(gyroscope[:: max(len(gyroscope) // 20_000, 1)], axis=0)
    leaps = [
        k
        for k in _leaps(accelerometer, _LEAST_TURN * gravity)
        if side <= k <= len(time_s) - side
        and time_s[k] - time_s[k - 1] < _GAP_STEPS * step
        and _is_unseen(
            accelerometer[k - side : k + side] / gravity, turning.scale * step * (gyroscope[k - side : k + side] - rest)
        )
    ]
    if not leaps:
        return []
    return [Finding.of(FindingCode.AXES_CHANGED, "leap", count=len(leaps), where=place(leaps[0]), sample=leaps[0])]


def _leaps(readings: FloatArray, least: float) -> list[int]:
    """Samples that differ from the one before by more than ``least``, in blocks that no long log makes large."""
    found: list[int] = []
    for first in range(0, len(readings) - 1, _BLOCK):
        change = np.diff(readings[first : first + _BLOCK + 1], axis=0)
        found += (first + 1 + np.flatnonzero((change**2).sum(axis=1) > least**2)).tolist()
    return found


def _is_unseen(gravity: FloatArray, turned_rad: FloatArray) -> bool:
    """Whether both halves of readings (2 n, 3) of gravity are calm, and the steps (2 n, 3) of the gyro explain no good
    part of what lies between."""
    halves = np.split(gravity, 2)
    before, after = (half.mean(axis=0) for half in halves)
    is_calm = all(bool(np.all(np.linalg.norm(half - half.mean(axis=0), axis=1) < _CALM)) for half in halves)
    turn = float(np.linalg.norm(after - before))
    n = len(gravity) // 2
    seen = float(np.linalg.norm(turned_rad[n // 2 : n + n // 2 + 1], axis=1).sum())
    return is_calm and turn > _LEAST_TURN and seen < _SEEN * turn
