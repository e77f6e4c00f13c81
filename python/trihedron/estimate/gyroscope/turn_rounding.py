"""Rounding errors of a coarse ADC in known turns and in the bias: a steady rate has one constant error."""

from collections.abc import Iterator

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.quantiles import medians
from trihedron.session.rounding import CHATTER, IN_STEP, STEADY, UNIFORM, undithered_axes

HIDDEN = (0.465, 0.567, 0.689, 1.0), (1.156, 0.957, 0.782, 0.500)
"""Table for a rate that settles as exp(-t/τ), then for rates that start as t⁴, t² and t: ratio of the time for the
second LSB to that for the first; time before the first code change in which the bias's position inside the LSB acts
as a rate, in times of the first LSB. With rate r reached at t(r), codes give Σ t'(k - ½) of the time in which it acts
(first order, mean of both directions): τ(2 ln 2 + γ + ln k), √k + ζ(½, ½)/2 of √k; before it the axis is static."""
STEPS = IN_STEP, 1.0 + IN_STEP, 2.0 + IN_STEP
"""Limits, in LSB from the static reading, of the static code, of the next code and of the one after it."""
LEAST_WHITE = 1e-2
"""Least white noise of an undithered axis, as a share of the rounding variance: its readings show none."""


def resting_axes(readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray) -> BoolArray:
    """(n, 3) whether an axis of ``axes`` (3,) rests: it is in the LSB of its bias for longer than it takes to leave it,
    while others rotate, or while the body stops inside a move."""
    return _core.resting_axes(readings, (quantum, rest, axes), STEADY)


def shared_errors(readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray) -> FloatArray:
    """Errors (n, 3, k) of one standard deviation each that all moves share: the rotation of an axis inside the LSB of
    its bias while another one leads."""
    found = _core.shared_errors(readings, (quantum, rest, axes), STEADY)
    out = np.zeros((*readings.shape, len(found)))
    for k, (axis, error) in enumerate(found):
        out[:, axis, k] = error
    return out


def density_without_rounding(density: FloatArray, quantum: FloatArray, step_s: float, axes: BoolArray) -> FloatArray:
    """Rate noise (3,) [raw·√s], on undithered axes without the rounding that :func:`rounding_variance` adds."""
    rounding = UNIFORM * quantum**2 * step_s
    rest = np.maximum(density**2 - rounding, LEAST_WHITE * rounding)
    return np.where(axes, np.sqrt(rest), density)


def static_reading(means: FloatArray, quantum: FloatArray) -> FloatArray:
    """(3,) mean of the means (n, 3) of the poses within an LSB of their median: a bias near the edge of a code has one
    code in some poses, the next one in others."""
    away = np.abs(means - medians(means))
    is_near = away <= np.maximum(quantum, away.min(axis=0))
    return np.asarray(np.mean(means, axis=0, where=is_near))


def resting_ends(
    readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray, edges: IntArray
) -> BoolArray:
    """Samples (n, 3) of ``axes`` (3,) at the ends of the moves ``edges`` (m, 2) at which the axis is static: in the LSB
    ``quantum`` (3,) of its static reading ``rest`` (3,), and not rotating yet, or no longer.

    Before its code changes an axis rotates undetected, further in the direction in which the bias is farther from the
    edge of the LSB: on the mean of both directions as if the position inside the LSB, as a rate, acted for a while;
    that time is not static. It is taken from the axis' own code changes; an axis without any is as static as the body,
    and a body without any is static throughout, but for :func:`unseen_rotation`.
    """
    out = np.zeros(readings.shape, dtype=np.bool_)
    for first, last in edges.tolist():
        part = readings[first:last]
        if not np.isfinite(part).all():
            continue
        away = _away(part, quantum, rest)
        for ends, inside in ((out[first:last], away), (out[first:last][::-1], away[::-1])):
            own = {k: _still(inside[:, k] / quantum[k]) for k in np.flatnonzero(axes).tolist()}
            body = min((n for n in own.values() if n is not None), default=len(part))
            for k, n in own.items():
                ends[: body if n is None else n, k] = True
    return out


def unseen_rotation(static: BoolArray, quantum: FloatArray, edges: IntArray) -> FloatArray:
    """Variance (n, 3) of the readings in those moves ``edges`` (m, 2) in which an axis is ``static`` (n, 3) throughout:
    it may rotate at any rate inside its LSB ``quantum`` (3,), which is one error of all their readings."""
    out = np.zeros(static.shape)
    for first, last in edges.tolist():
        out[first:last] = np.where(static[first:last].all(axis=0), (last - first) * UNIFORM * quantum**2, 0.0)
    return out


def _away(readings: FloatArray, quantum: FloatArray, rest: FloatArray) -> FloatArray:
    """Distance (n, 3) from ``rest``, raw, without toggling between neighbouring codes (running median)."""
    columns = [_core.running_median(np.ascontiguousarray(column), CHATTER) for column in readings.T]
    return np.maximum(np.abs(np.column_stack(columns) - rest), np.abs(readings - rest) - quantum)


def _still(away: FloatArray) -> int | None:
    """Number of static samples before a rotation, from ``away`` (n,) [LSB] of rest; ``None`` without a code change."""
    left = [int(np.argmax(away >= step)) if np.any(away >= step) else None for step in STEPS]
    begin, second, third = left
    if begin is None:
        return None
    if second is None or third is None:
        return begin
    took = max(second - begin, 1)
    return max(begin - round(took * float(np.interp((third - second) / took, *HIDDEN))), 0)


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
