"""Detects gravity that rotates between two samples without a gyro rate: both sensors' axes changed, or rows are cut."""

from collections.abc import Callable

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.read.clock.rate import usual_step
from trihedron.read.turning import Turning
from trihedron.records import Finding, FindingCode
from trihedron.records.words import Words

_LEAST_TURN = 0.35
"""Smallest change, as a fraction of gravity (20 degrees), which no bias can explain."""
_CALM = 0.1
"""Largest deviation of readings on either side from their mean, as a fraction of gravity; a shock exceeds it."""
_SEEN = 0.25
"""Largest part of the rotation that the gyro may have measured, between the middles of both sides."""
_SIDE_S, _FEWEST = 0.1, 5
_SLOWEST_HZ = 20.0
"""Lowest rate at which it is tested: by hand a rotation of 20 degrees takes at least a twentieth of a second."""
_GAP_STEPS = 1.5
_BLOCK = 1 << 20


def audit_seam(
    time_s: FloatArray,
    accelerometer: FloatArray,
    gyroscope: FloatArray,
    turning: Turning,
    place: Callable[[int], Words],
) -> list[Finding]:
    """A finding where gravity jumps between two consecutive samples, with the sensor static before and after.

    Parameters
    ----------
    time_s : array (n,) [s]
    accelerometer, gyroscope : array (n, 3), in any unit
    turning : Turning
        The gyro's scale from the rotation of gravity in the whole log.
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
    """Samples that differ from the previous one by more than ``least``, computed in blocks to limit memory."""
    found: list[int] = []
    for first in range(0, len(readings) - 1, _BLOCK):
        change = np.diff(readings[first : first + _BLOCK + 1], axis=0)
        found += (first + 1 + np.flatnonzero((change**2).sum(axis=1) > least**2)).tolist()
    return found


def _is_unseen(gravity: FloatArray, turned_rad: FloatArray) -> bool:
    """Whether both halves of gravity (2 n, 3) are constant, and the gyro's rotation per sample (2 n, 3) [rad] explains
    less than ``_SEEN`` of the change between them."""
    halves = np.split(gravity, 2)
    before, after = (half.mean(axis=0) for half in halves)
    is_calm = all(bool(np.all(np.linalg.norm(half - half.mean(axis=0), axis=1) < _CALM)) for half in halves)
    turn = float(np.linalg.norm(after - before))
    n = len(gravity) // 2
    seen = float(np.linalg.norm(turned_rad[n // 2 : n + n // 2 + 1], axis=1).sum())
    return is_calm and turn > _LEAST_TURN and seen < _SEEN * turn
