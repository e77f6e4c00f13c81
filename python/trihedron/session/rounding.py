"""Rate hidden inside one LSB of a coarse ADC, in poses and in moves."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.quantiles import medians
from trihedron.ranges import ranges_of

UNIFORM = 1.0 / 12.0
"""Variance of an error that is uniform over one step, in squares of the step."""
IN_STEP = 0.95
"""Distance from the mean reading of the bias, in LSB, within which a code is one of the two between which the bias
toggles; of a code read less often, one in twenty times, the running median leaves nothing."""
UNDITHERED = 0.5
"""Noise, in LSB, below which it does not dither the ADC: the mean of rounded readings is wrong by up to half an LSB,
however long it is taken."""
SETTLING = (0.50, 0.68), (2.5, 1.25)
"""For a body that settles as exp(-t/τ), then for one that starts as t²: duration of the second step beside the bias's
over that of the first, and samples per sample of the first step. Over these the rotation hidden in the bias's step is,
rms over the place of the bias, as large as a uniform error of one step."""
TURNING = 2.0 / (math.sqrt(2.0) - 1.0)
"""Longest time a rate that turns back as t² stays in a step, in mean durations of the steps beside it; a rate that
stays longer is constant."""
TURNED = 1.0 / 3.0
"""Mean square of the common error of such a turn's readings over that of a constant rate: ``(2h/3 - 1/2)²`` of a step
for a turn at height ``h`` in it, averaged over ``h`` with the number of readings, which grows as ``√h``."""
CHATTER = 9
"""Length of the running median, in readings, that removes toggling between neighbouring codes."""
LEAST_WHITE = 1e-2
"""Least white noise of an undithered axis, as a share of the rounding variance: its readings show none."""


def undithered_axes(quantum: FloatArray, sigma: FloatArray) -> BoolArray:
    """Axes (3,) whose noise does not dither the LSB ``quantum`` (3,), by the scatter ``sigma`` (3,) of readings."""
    white = np.sqrt(np.maximum(sigma**2 - quantum**2 / 12.0, 0.0))
    return (quantum > 0.0) & (white < UNDITHERED * quantum)


def rounding_variance(
    readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray
) -> FloatArray | None:
    """Rounding variance (n, 3) of readings for sums that treat them as independent; ``None`` where no axis needs it.

    While the rate passes through a step from one side to the other, the errors of the ``n`` readings inside take all
    values of the step and cancel except for one: ``q²/12`` for the run, ``q²/12n`` per reading. Where the rate turns
    back inside the step, the readings share one error: their sum has the variance ``n² q²/12``, that is ``n q²/12`` per
    reading, and a third of it where the rate turns at once (:data:`TURNED`). In the step of the ``rest`` reading (3,)
    the error is that of the bias, which is not included here, except at the start and the end of a move that are still
    inside that step; NaN where there is no bias.
    """
    if not np.any(axes):
        return None
    out = np.zeros(readings.shape)
    for axis in np.flatnonzero(axes):
        codes, steady = _steady(readings[:, axis])
        out[:, axis] = _of_runs(codes, steady, float(quantum[axis]), float(rest[axis]))
    for still, begin, end in _standing(readings, quantum, rest, axes):
        # The part of the others' rotation along a resting axis stays inside its step all the time.
        out[begin:end, still] = np.maximum(out[begin:end, still], (end - begin) * UNIFORM * quantum[still] ** 2)
    return out


def rounding_of_moves(
    readings: FloatArray, ranges: list[tuple[int, int]], quantum: FloatArray, sigma: FloatArray
) -> FloatArray:
    """Variance (moves, 3) of the sums of readings (n, 3) over ``ranges``; noise ``sigma`` (3,) may not dither the ADC.

    A move begins and ends in the LSB of its poses: its readings there have the same error as their means.
    """
    axes = undithered_axes(quantum, sigma)
    nowhere = np.full(3, np.nan)
    found = [rounding_variance(readings[a:b], quantum, nowhere, axes) for a, b in ranges]
    return np.array([np.zeros(3) if of_move is None else of_move.sum(axis=0) for of_move in found]).reshape(-1, 3)


def _steady(readings: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Codes (n,), missing ones infinite, and their running median.

    Small noise makes readings toggle between codes where they pass: such runs say nothing about the duration of a step.
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
    return out * UNIFORM * quantum**2


def _turns_at_once(count: IntArray) -> BoolArray:
    """Whether runs of ``count`` readings, too long for toggling, are as short beside their neighbours as in a turn."""
    out = np.zeros(len(count), dtype=np.bool_)
    clean = np.minimum(np.minimum(count[:-2], count[2:]), count[1:-1]) > CHATTER // 2
    out[1:-1] = clean & (count[1:-1] < 0.5 * TURNING * (count[:-2] + count[2:]))
    return out


def resting_axes(readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray) -> BoolArray:
    """(n, 3) whether an axis of ``axes`` (3,) rests: it is in the LSB of its bias for longer than it takes to leave it,
    while others rotate, or while the body stops inside a move."""
    out = np.zeros(readings.shape, dtype=np.bool_)
    for axis in np.flatnonzero(axes).tolist():
        for first, last, left, right in _rests(_steady(readings[:, axis])[1], float(quantum[axis]), float(rest[axis])):
            if last - right - first - left > max(left, right):
                out[first + left : last - right, axis] = True
    return out


def _standing(
    readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray
) -> Iterator[tuple[int, int, int]]:
    """(axis, begin, end) where an axis stays in the LSB of its bias while others rotate, for longer than it takes to
    leave it: where all axes rotate, each passes that step or leaves it with the others."""
    turns = np.abs(readings - rest) > (1.0 + IN_STEP) * quantum
    for axis in np.flatnonzero(axes).tolist():
        others = np.any(turns[:, np.arange(3) != axis], axis=1)
        steady = _steady(readings[:, axis])[1]
        for first, last, left, right in _rests(steady, float(quantum[axis]), float(rest[axis])):
            inside = first + left, last - right
            for begin, end in ranges_of(others[inside[0] : inside[1]]):
                if end - begin > max(left, right):
                    yield axis, inside[0] + begin, inside[0] + end


def _rests(steady: FloatArray, quantum: float, rest: float) -> Iterator[tuple[int, int, int, int]]:
    """Ranges (begin, end) in which an axis stays in the LSB of its bias, and the samples at either end in which it may
    rotate undetected."""
    away = np.abs(steady - rest)
    is_rest, is_next, is_beyond = (away < (steps + IN_STEP) * quantum for steps in range(3))
    at_rest, beyond = ranges_of(is_rest), ranges_of(is_beyond)
    for first, last in ranges_of(is_next):
        # Each of these ranges lies within one of the next: they are found by their starts.
        inside = at_rest[bisect_left(at_rest, (first,)) : bisect_left(at_rest, (last,))]
        if not inside:
            continue
        n, begin, end = max((b - a, a, b) for a, b in inside)
        # The signs of the moves before and after do not matter.
        outer = beyond[bisect_right(beyond, (first, math.inf)) - 1]
        left = _hidden(begin - first, first - outer[0]) if first > 0 else 0
        right = _hidden(last - end, outer[1] - last) if last < len(steady) else 0
        if n > min(left, right):  # otherwise passed through, or turned back inside
            yield begin, end, min(left, n), min(right, n)


def _hidden(first_step: int, second_step: int) -> int:
    """Samples with rounding variance next to the LSB of the bias, from the durations of the two steps beside it."""
    ratio = second_step / max(first_step, 1)
    return math.ceil(first_step * float(np.interp(ratio, *SETTLING)))


def shared_errors(readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray) -> Iterator[FloatArray]:
    """Errors (n, 3) of one standard deviation each that all moves share: the rotation of an axis inside the LSB of its
    bias while another one leads. It is due to their misalignment and changes sign with the rotation: it does not
    scatter from move to move.
    """
    away = (readings - rest) / np.where(quantum > 0.0, quantum, np.inf)
    size = np.abs(away)
    lead = np.argmax(size, axis=1)
    turns = np.max(size, axis=1) > 1.0 + IN_STEP
    for axis in np.flatnonzero(axes).tolist():
        is_inside = turns & (size[:, axis] < IN_STEP) & (lead != axis)
        for other in range(3):
            way = np.where(is_inside & (lead == other), np.sign(away[:, other]), 0.0)
            if np.any(way):
                out = np.zeros(readings.shape)
                out[:, axis] = way * quantum[axis] * math.sqrt(UNIFORM)
                yield out


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


@dataclass(frozen=True, eq=False)
class BeforeAdc:
    """Readings of poses before an ADC, in its steps: ``sigma`` the white noise of one; ``shift`` (h,) posterior less
    plain means; ``own`` (h,) standard deviation of each mean by itself, ``common`` the one that all share."""

    sigma: float
    shift: FloatArray
    own: FloatArray
    common: float


def before_adc(poses: list[FloatArray], step: float) -> BeforeAdc:
    """Noise and means of the ``poses`` before an ADC of ``step``, by the shares of their codes: interval-censored
    normal readings, their means scattered about one.

    A pose whose mean is at the centre of a code has no scatter, at its edge half an LSB, whatever the noise: below half
    an LSB the scatter does not determine the noise. Two codes leave noise and mean undetermined together (``common``).
    """
    return BeforeAdc(*_core.before_adc(np.concatenate(poses), [len(one) for one in poses], step))
