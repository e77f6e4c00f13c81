"""Rate hidden inside one LSB of a coarse ADC, in poses and in moves."""

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.quantiles import medians

UNIFORM = 1.0 / 12.0
"""Variance of an error that is uniform over one step, in squares of the step."""
IN_STEP = 0.95
"""Distance from the mean reading of the bias, in LSB, within which a code is one of the two between which the bias
toggles; of a code read less often, one in twenty times, the running median leaves nothing."""
TWO_CODES = 0.25
"""Largest variance, in squares of the step, of readings that toggle between two codes. With less the noise does not
dither the ADC: the mean of rounded readings is wrong by up to half an LSB, however long it is taken."""
CHATTER = 9
"""Length of the running median, in readings, that removes toggling between neighbouring codes."""
STEADY = IN_STEP, CHATTER
HIDDEN = (0.465, 0.567, 0.689, 1.0), (1.156, 0.957, 0.782, 0.500)
"""Table for a rate that settles as exp(-t/τ), then for rates that start as t⁴, t² and t: ratio of the time for the
second LSB to that for the first; time before the first code change in which the bias's position inside the LSB acts
as a rate, in times of the first LSB. With rate r reached at t(r), codes give Σ t'(k - ½) of the time in which it acts
(first order, mean of both directions): τ(2 ln 2 + γ + ln k), √k + ζ(½, ½)/2 of √k; before it the axis is static."""
STEPS = IN_STEP, 1.0 + IN_STEP, 2.0 + IN_STEP
"""Limits, in LSB from the static reading, of the static code, of the next code and of the one after it."""
LEAST_WHITE = 1e-2
"""Least white noise of an undithered axis, as a share of the rounding variance: its readings show none."""


def undithered_axes(quantum: FloatArray, sigma: FloatArray) -> BoolArray:
    """Axes (3,) whose noise does not dither the LSB ``quantum`` (3,), by the scatter ``sigma`` (3,) of readings."""
    return (quantum > 0.0) & (sigma**2 < TWO_CODES * quantum**2)


def rounding_variance(
    readings: FloatArray, quantum: FloatArray, rest: FloatArray, axes: BoolArray
) -> FloatArray | None:
    """Rounding variance (n, 3) of readings for sums that treat them as independent; ``None`` where no axis needs it.

    In the LSB ``quantum`` (3,) of the ``rest`` reading (3,) the error is that of the bias, which is not included here,
    except at the start and the end of a move that are still inside that step; NaN where there is no bias.
    """
    return _core.rounding_variance(readings, (quantum, rest, axes), STEADY) if np.any(axes) else None


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


def rounding_in_moves(
    readings: FloatArray, quantum: FloatArray, means: FloatArray, axes: BoolArray, edges: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rounding of undithered ``axes`` (3,) in the moves ``edges`` (m, 2): variance (n, 3), 1 where a reading is in the
    LSB of its bias (n, 3), errors (n, 3, k) that all moves share. ``means`` (h, 3) are those of the poses."""
    coarse = readings, quantum, static_reading(means, quantum), axes
    variance = rounding_variance(*coarse)
    if variance is None:
        return np.zeros(readings.shape), np.zeros(readings.shape), np.zeros((*readings.shape, 0))
    is_static = resting_ends(*coarse, edges) | resting_axes(*coarse)
    variance = np.maximum(variance, unseen_rotation(is_static, quantum, edges))
    return variance, is_static.astype(np.float64), shared_errors(*coarse)


def biases_by_codes(
    read: FloatArray, poses: list[FloatArray], quantum: FloatArray, axes: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Biases (h, 3) of the ``poses``, each (n, 3), on undithered ``axes``, as their codes show them to change about the
    mean of what was ``read``, with standard errors (h, 3). The place of all inside the LSB is left to the moves."""
    out, own = read.copy(), np.zeros(read.shape)
    for axis in np.flatnonzero(axes).tolist():
        readings = [pose[:, axis] for pose in poses]
        found = before_adc([one[np.isfinite(one)] for one in readings], float(quantum[axis]))
        out[:, axis] += quantum[axis] * (found.shift - found.shift.mean())
        own[:, axis] = quantum[axis] * found.own
    return out, own
