"""Where a coarse gyro is still, or not yet beyond a step, at the ends of a move: its reading there is the bias's."""

from __future__ import annotations

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.session.rounding import CHATTER

HIDDEN = (0.465, 0.567, 0.689, 1.0), (1.156, 0.957, 0.782, 0.500)
"""Of a body that settles as exp(-t/τ), then of those that start as t⁴, t² and t do: time for the second step beside its
bias's in that for the first, and how long its place inside the step acts, as a rate, before it leaves, in units of the
first. At a rate r, reached at t(r), codes tell Σ t'(k - ½) of the time in which the place acts (to first order in the
place, on the mean of both ways), that is τ(2 ln 2 + γ + ln k), or √k + ζ(½, ½)/2 of √k; what is left is still."""
STEPS = 0.75, 1.75, 2.75
"""Distance from the reading at rest, in steps, up to which a reading is at rest, one step beside, two."""


def resting_ends(
    readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray, edges: IntArray
) -> BoolArray:
    """Readings (n, 3) of ``axes`` (3,) at the ends of moves ``edges`` (m, 2) at which an axis does not turn yet, or no
    more, until it leaves the step ``quantum`` (3,) of its reading at ``rest`` (3,).

    Before it leaves, it turns unseen, by more against its place inside the step than with it: on the mean of both ways
    as if that place, read as a rate, had acted for a while, and for so long it is not still. Each axis by what it shows
    itself, for one that leaves later was slower; one that never leaves is as still as the body.
    """
    out = np.zeros(readings.shape, dtype=np.bool_)
    for first, last in edges.tolist():
        part = readings[first:last]
        if not np.isfinite(part).all():
            continue
        away = _away(part, quantum, rest)
        for ends, inside in ((out[first:last], away), (out[first:last][::-1], away[::-1])):
            own = {k: _still(inside[:, k] / quantum[k]) for k in np.flatnonzero(axes).tolist()}
            body = min((n for n in own.values() if n is not None), default=0)
            for k, n in own.items():
                ends[: body if n is None else n, k] = True
    return out


def _away(readings: FloatArray, quantum: FloatArray, rest: FloatArray) -> FloatArray:
    """Distance (n, 3) from ``rest`` without toggling between neighbouring codes; what is further was no toggling."""
    columns = [_core.running_median(np.ascontiguousarray(column), CHATTER) for column in readings.T]
    away: FloatArray = np.maximum(np.abs(np.column_stack(columns) - rest), np.abs(readings - rest) - quantum)
    return away


def _still(away: FloatArray) -> int | None:
    """Readings before a move that ``away`` (n,) [steps] from rest shows; ``None`` where it shows none."""
    left = [int(np.argmax(away >= step)) if np.any(away >= step) else None for step in STEPS]
    begin, second, third = left
    if begin is None:
        return None
    if second is None or third is None:
        return begin
    took = max(second - begin, 1)
    return max(begin - round(took * float(np.interp((third - second) / took, *HIDDEN))), 0)
