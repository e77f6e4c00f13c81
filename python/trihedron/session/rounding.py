"""What a coarse ADC hides: the rate inside one step, at rest and in moves."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.ranges import ranges_of

UNDITHERED = 0.5
"""Noise below this part of a step does not dither it: the mean of a rounded reading is off by up to half a step,
however long it is taken."""
SETTLING = (0.50, 0.68), (2.5, 1.25)
"""Of a body that settles as exp(-t/τ), then of one that starts as t² does: time for the second step beside its bias's
in that for the first, and the samples over which what it still turns, rms over where in its step the bias may lie, is
a step's uniform error, for each sample that the first step took."""
TURNING = 2.0 / (math.sqrt(2.0) - 1.0)
"""How many times as long as in the steps beside it a rate stays, at most, in the one in which it turns back as t² does;
one that stays longer is steady."""
TURNED = 1.0 / 3.0
"""Mean square of what such a turn's readings are off together, beside that of a steady rate: ``(2h/3 - 1/2)²`` of a
step for a turn at ``h`` of it, in the mean over ``h`` of readings, which are as ``√h``."""
CHATTER = 9
"""Readings whose median is free of toggling between neighbouring codes."""
LEAST_WHITE = 1e-2
"""Part of the rounding's variance that an undithered axis is given as white noise: it shows none of its own."""


def undithered_axes(quantum: FloatArray, sigma: FloatArray) -> BoolArray:
    """Axes (3,) whose noise ``sigma`` (3,) [raw] is too small to be seen through the ADC's ``quantum`` (3,)."""
    return (quantum > 0.0) & (sigma < UNDITHERED * quantum)


def rounding_variance(
    readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray
) -> FloatArray | None:
    """Variance (n, 3) by rounding of readings summed as if independent; ``None`` where no axis needs it.

    While the rate passes through a step from one side to the other, the errors of the ``n`` readings inside run through
    all values of the step and cancel but for one of them: ``q²/12`` for the run, ``q²/12n`` a reading. Where the rate
    stands inside the step and turns back, the readings share one error: their sum has the variance ``n² q²/12``, that
    is ``n q²/12`` a reading, and a third of it where the rate turns at once (:data:`TURNED`). At the ``rest`` reading
    (3,) the error is that of the bias, which is not charged here but for the start and the end of a move that still lie
    inside the step; NaN where there is none.
    """
    if not np.any(axes):
        return None
    out = np.zeros(readings.shape)
    for axis in np.flatnonzero(axes):
        codes, steady = _steady(readings[:, axis])
        out[:, axis] = _of_runs(codes, steady, float(quantum[axis]), float(rest[axis]))
    for still, begin, end in _standing(readings, quantum, rest, axes):
        # What of the others' turn reaches an axis that stands still stays inside its step, all along.
        out[begin:end, still] = np.maximum(out[begin:end, still], (end - begin) * quantum[still] ** 2 / 12.0)
    return out


def rounding_of_moves(
    readings: FloatArray, ranges: list[tuple[int, int]], quantum: FloatArray, sigma: FloatArray
) -> FloatArray:
    """Variance (moves, 3) of the sums of readings (n, 3) over ``ranges``, of noise ``sigma`` (3,) that may not dither.

    A move begins and ends in the steps of its poses: what it reads there is off by as much as their means.
    """
    axes = undithered_axes(quantum, sigma)
    nowhere = np.full(3, np.nan)
    found = [rounding_variance(readings[a:b], quantum, nowhere, axes) for a, b in ranges]
    return np.array([np.zeros(3) if of_move is None else of_move.sum(axis=0) for of_move in found]).reshape(-1, 3)


def _steady(readings: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Codes (n,), missing ones infinite, and their running median.

    A little noise makes readings toggle where they pass from code to code: runs there say nothing of the time.
    """
    codes = np.where(np.isfinite(readings), readings, np.inf)
    return codes, _core.running_median(codes, CHATTER)


def _of_runs(codes: FloatArray, steady: FloatArray, quantum: float, rest: float) -> FloatArray:
    begins = np.concatenate([[0], np.flatnonzero(codes[1:] != codes[:-1]) + 1])
    count = np.diff(np.concatenate([begins, [len(codes)]]))
    level = codes[begins]
    with np.errstate(invalid="ignore"):
        step = np.sign(np.diff(level))
    is_passed = np.zeros(len(level), dtype=bool)
    is_passed[1:-1] = step[1:] * step[:-1] > 0.0
    share = np.where(_turns_at_once(count), TURNED * count, count)
    out = np.repeat(np.where(is_passed, 1.0 / count, share).astype(np.float64), count)
    for begin, end, left, right in _rests(steady, quantum, rest):
        n = end - begin
        part = np.zeros(n)
        part[:left] = left
        if right:
            part[-right:] = np.maximum(part[-right:], right)
        out[begin:end] = part
    return out * quantum**2 / 12.0


def _turns_at_once(count: IntArray) -> BoolArray:
    """Whether runs of ``count`` readings, too long for toggling, are as short beside their neighbours as a turn's."""
    out = np.zeros(len(count), dtype=np.bool_)
    clean = np.minimum(np.minimum(count[:-2], count[2:]), count[1:-1]) > CHATTER // 2
    out[1:-1] = clean & (count[1:-1] < 0.5 * TURNING * (count[:-2] + count[2:]))
    return out


def resting_axes(readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray) -> BoolArray:
    """Readings (n, 3) of ``axes`` (3,) at which the axis stands still while another one turns."""
    out = np.zeros(readings.shape, dtype=np.bool_)
    for axis, begin, end in _standing(readings, quantum, rest, axes):
        out[begin:end, axis] = True
    return out


def _standing(
    readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray
) -> Iterator[tuple[int, int, int]]:
    """(axis, begin, end) where an axis stays in the step of its bias, others turning, longer than it takes to leave it:
    where all axes turn, each passes that step or leaves it with the others."""
    turns = np.abs(readings - rest) > 1.75 * quantum
    for axis in np.flatnonzero(axes).tolist():
        others = np.any(turns[:, np.arange(3) != axis], axis=1)
        steady = _steady(readings[:, axis])[1]
        for first, last, left, right in _rests(steady, float(quantum[axis]), float(rest[axis])):
            inside = first + left, last - right
            for begin, end in ranges_of(others[inside[0] : inside[1]]):
                if end - begin > max(left, right):
                    yield axis, inside[0] + begin, inside[0] + end


def _rests(steady: FloatArray, quantum: float, rest: float) -> Iterator[tuple[int, int, int, int]]:
    """Stretches (begin, end) in which an axis stands in the step of its bias, and the samples at either end in which it
    may turn unseen."""
    away = np.abs(steady - rest)
    # Between the two nearest codes a bias may toggle.
    is_rest, is_next = away < 0.75 * quantum, away < 1.75 * quantum
    at_rest, beyond = ranges_of(is_rest), ranges_of(away < 2.75 * quantum)
    for first, last in ranges_of(is_next):
        inside = [(b - a, a, b) for a, b in at_rest if first <= a and b <= last]
        if not inside:
            continue
        n, begin, end = max(inside)
        # Whether the move before and the one after go the same way says nothing.
        outer = next(one for one in beyond if one[0] <= first and last <= one[1])
        left = _hidden(begin - first, first - outer[0]) if first > 0 else 0
        right = _hidden(last - end, outer[1] - last) if last < len(steady) else 0
        if n > min(left, right):  # else passed on the way, or turned back in
            yield begin, end, min(left, n), min(right, n)


def _hidden(first_step: int, second_step: int) -> int:
    """Samples charged next to the step of the bias, by how long the two steps beside it took."""
    ratio = second_step / max(first_step, 1)
    return math.ceil(first_step * float(np.interp(ratio, *SETTLING)))


def shared_errors(readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray) -> Iterator[FloatArray]:
    """Errors (n, 3) of one standard deviation each that all moves share: what an axis turns inside the step of its bias
    while another one leads. Their misalignment makes it, the other way in turns the other way: it does not scatter from
    move to move.
    """
    away = (readings - rest) / np.where(quantum > 0.0, quantum, np.inf)
    size = np.abs(away)
    lead = np.argmax(size, axis=1)
    turns = np.max(size, axis=1) > 1.75
    for axis in np.flatnonzero(axes).tolist():
        is_inside = turns & (size[:, axis] < 0.75) & (lead != axis)
        for other in range(3):
            way = np.where(is_inside & (lead == other), np.sign(away[:, other]), 0.0)
            if np.any(way):
                out = np.zeros(readings.shape)
                out[:, axis] = way * quantum[axis] / math.sqrt(12.0)
                yield out


def density_without_rounding(density: FloatArray, quantum: FloatArray, step_s: float, axes: BoolArray) -> FloatArray:
    """Rate noise (3,) [raw·√s], on undithered axes without the rounding that :func:`rounding_variance` adds."""
    rounding = quantum**2 / 12.0 * step_s
    rest = np.maximum(density**2 - rounding, LEAST_WHITE * rounding)
    return np.where(axes, np.sqrt(rest), density)


def common_bias(bias: FloatArray, var_bias: FloatArray, axes: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Biases (n, 3) and variances of undithered axes: one bias for all poses, as uncertain between them as it scatters.

    A mean that rounding has moved says nothing of its own pose; what is common to all poses is left to the moves.
    """
    bias, var_bias = bias.copy(), var_bias.copy()
    for axis in np.flatnonzero(axes):
        scatter = float(np.var(bias[:, axis]))
        bias[:, axis] = float(np.mean(bias[:, axis]))
        var_bias[:, axis] = var_bias[:, axis] + scatter
    return np.ascontiguousarray(bias), np.ascontiguousarray(var_bias)
