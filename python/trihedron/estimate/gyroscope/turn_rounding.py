"""Rounding errors of a coarse ADC in known turns and in the bias: a steady rate has one constant error."""

from collections.abc import Iterator

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.session.rounding import CHATTER, IN_STEP, undithered_axes


def hidden_angles(
    readings: FloatArray, step_s: float, quantum: FloatArray, turns: IntArray, static: IntArray, raw_angle: FloatArray
) -> FloatArray:
    """(k, 3, m) errors of the raw angles of turns (k, 2) by rounding to ``quantum`` (3,), per σ of m independent ones;
    m = 0 where noise dithers all axes. ``static`` (z, 2) are intervals without rotation.

    While a rate stays inside an LSB its error is constant, uniform with variance q²/12: over T seconds the angle error
    is ``q T/√12`` rms. Turns about one axis in one sense with the same code may have one rate (a table's): they share
    the error, and so do all static intervals. Another code, sense or axis has an independent error: with w' = z at rest
    and z ± mω across a turn there and back, all in one code, (z, mω) is uniform on ``|z| + |mω| < q/2``, where mω has
    the variance q²/24 that two independent errors give it. Codes that a turn passes through cancel but for one reading.
    """
    still = np.concatenate([readings[a:b] for a, b in static.tolist()])
    rest = np.nanmedian(still, axis=0)
    columns: dict[tuple[int, ...], FloatArray] = {}
    for axis in np.flatnonzero(undithered_axes(quantum, np.nanstd(still, axis=0))).tolist():
        size = float(quantum[axis]) / np.sqrt(12.0)
        for row, (a, b) in enumerate(turns.tolist()):
            # Axis and sense of the turn: those of the largest raw angle.
            main = int(np.argmax(np.abs(raw_angle[row])))
            sense = (main + 1) * int(np.sign(raw_angle[row, main]))
            for first, last, level in _dwells(readings[a:b, axis]):
                is_end = (first == 0) != (last == b - a)
                is_rest = is_end and abs(level - rest[axis]) < IN_STEP * quantum[axis]
                key = (axis,) if is_rest else (axis, round(level / float(quantum[axis])), sense)
                error = columns.setdefault(key, np.zeros((len(turns), 3)))
                error[row, axis] += size * (last - first) * step_s
    return np.stack(list(columns.values()), axis=2) if columns else np.zeros((len(turns), 3, 0))


def _dwells(readings: FloatArray) -> Iterator[tuple[int, int, float]]:
    """Stretches of one code without toggling, except those that the rate passes through: first, last (exclusive),
    reading."""
    codes = _core.running_median(np.ascontiguousarray(np.where(np.isfinite(readings), readings, np.inf)), CHATTER)
    begins = np.concatenate([[0], np.flatnonzero(codes[1:] != codes[:-1]) + 1])
    ends = np.concatenate([begins[1:], [len(codes)]])
    level = codes[begins]
    with np.errstate(invalid="ignore"):
        sense = np.sign(np.diff(level))
    for k, (first, last) in enumerate(zip(begins.tolist(), ends.tolist(), strict=True)):
        is_passed = 0 < k < len(level) - 1 and sense[k - 1] * sense[k] > 0.0
        if not is_passed:
            yield first, last, float(level[k]) if np.isfinite(level[k]) else 0.0
