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
LEAST_WHITE = 1e-2
"""Least share of a variance that is left once rounding is taken out of it: undithered readings show none."""


def undithered_axes(quantum: FloatArray, sigma: FloatArray) -> BoolArray:
    """Axes (3,) whose noise does not dither the LSB ``quantum`` (3,), by the scatter ``sigma`` (3,) of readings."""
    return (quantum > 0.0) & (sigma**2 < TWO_CODES * quantum**2)


def rounding_of_moves(
    readings: FloatArray, ranges: list[tuple[int, int]], quantum: FloatArray, sigma: FloatArray
) -> FloatArray:
    """Variance (moves, 3) of the sums of readings (n, 3) over ``ranges`` by rounding to the LSB ``quantum`` (3,), as of
    independent ones; noise ``sigma`` (3,) may not dither the ADC.

    A move begins and ends in the LSB of its poses: its readings there have the same error as their means.
    """
    axes, nowhere = undithered_axes(quantum, sigma), np.full(3, np.nan)
    if not axes.any():
        return np.zeros((len(ranges), 3))
    adc = quantum, nowhere, axes
    found = [_core.rounding_variance(readings[a:b], adc, STEADY).sum(axis=0) for a, b in ranges]
    return np.array(found).reshape(-1, 3)


def density_without_rounding(density: FloatArray, quantum: FloatArray, step_s: float, axes: BoolArray) -> FloatArray:
    """Rate noise (3,) [raw·√s], on undithered axes without the rounding that is added reading by reading."""
    rounding = UNIFORM * quantum**2 * step_s
    rest = np.maximum(density**2 - rounding, LEAST_WHITE * rounding)
    return np.where(axes, np.sqrt(rest), density)


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


def rounding_in_moves(
    readings: FloatArray, quantum: FloatArray, means: FloatArray, axes: BoolArray, edges: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rounding of undithered ``axes`` (3,) in the moves ``edges`` (m, 2): variance (n, 3), 1 where a reading is in the
    LSB of its bias (n, 3), errors (n, 3, k) that all moves share. ``means`` (h, 3) are those of the poses."""
    # A bias near the edge of a code has one code in some poses, the next one in others.
    away = np.abs(means - medians(means))
    rest = np.mean(means, axis=0, where=away <= np.maximum(quantum, away.min(axis=0)))
    return _core.rounding_in_moves(readings, (quantum, rest, axes), edges, STEADY)


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
