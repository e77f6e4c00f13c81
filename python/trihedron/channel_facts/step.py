"""The step of a converter, from the values that occur: the only place that looks for it."""

from __future__ import annotations

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray

PROBED = 1 << 14
"""Readings, evenly spread over a channel, whose values are looked at: sorting them takes half a millisecond."""
ARITHMETIC = 1e-9
"""Values that differ by less, as a part of the largest, are one: so far the arithmetic of a conversion rounds."""
WRITTEN = 0.02
"""Values closer than this part of a step are one code whose last digit was written in two ways."""
MOST_WRITTEN = 0.05
"""Part of a step that the spellings of a code may span on average: more, and they are codes of their own."""
QUANTILES = (0.9, 0.75, 0.5, 0.25, 0.1, 0.05, 0.01, 0.0)
"""Gaps between neighbouring values that are tried as the step, coarse before fine: most neighbours are one step apart
where all codes were visited, the smallest gap is two spellings of one code where digits were written."""
OFF_GRID = 0.18
"""Part of a step by which a gap may miss a whole number of steps: a third of it where text has cut three digits in a
step (half a digit at either end), and a margin. Gaps of continuous readings are so near by chance in 36 of 100."""
ON_GRID = 0.95
"""Part of the gaps that must be whole."""
REACH = 20.0
"""Steps of a gap beyond which its being whole says nothing: the error of the step itself has grown to its size."""
DENSE = 32
"""Levels of the densest stretch, where the refinement of the step begins."""
WIDER = 4.0
"""The step is refined over levels ever further apart: each reach tells it well enough for one so much wider."""
TESTABLE = 8
"""Gaps within reach, of many, that are evidence: all of them are whole by chance once in 0.36⁻⁷ = 1300 logs."""
BY_CHANCE = 1e-3
"""Fewer gaps must be whole by so much that chance does it as seldom, or all be one step."""
REPEATS = 2
"""And the readings must repeat then, so many times a value."""
DRIFT = 0.3
"""Part by which what all gaps say of the step may differ from the gap that was tried: more, and it was another."""
MOST_GAPS = 4096
"""Gaps that are looked at, evenly spread where there are more."""
PARTS = 8
"""Where the whole log has no grid its parts may: a range was changed, or another sensor took over."""


def probe(readings: FloatArray) -> FloatArray:
    """The readings (k, ...) of (n, ...) that are looked at."""
    out: FloatArray = readings[:: probe_stride(len(readings))]
    return out


def probe_stride(n: int) -> int:
    """Every which of n readings is looked at."""
    return max(1, -(-n // PROBED))


def converter_step(readings: FloatArray) -> float:
    """Spacing of the grid on which readings (n,) lie, in their unit; 0 where they lie on none that can be seen.

    Readings in counts, in units converted from counts, and decimals as written are told alike. Without a code between
    them visited values are several steps apart; then the step is what all gaps are multiples of. Of a log that changes
    its step, the one of most of its parts is returned; of two that are multiples of a third, the third.

    Examples
    --------
    >>> import numpy as np
    >>> noise = np.random.default_rng(1).normal(size=2000)
    >>> converter_step(0.25 * np.round(2.0 * noise)), converter_step(noise)
    (0.25, 0.0)
    """
    seen = np.ascontiguousarray(probe(readings))
    levels, n = _core.levels_of(seen)
    step = _grid(levels, n)
    # Where most values occur once, no step matters beside the noise.
    if step or len(levels) < TESTABLE or REPEATS * len(levels) > n:
        return step
    parts = [_core.levels_of(part) for part in np.array_split(seen, PARTS)]
    steps = [_grid(*part) for part in parts if len(part[0]) > TESTABLE]
    return float(np.median(steps)) if steps and all(steps) else 0.0


def converter_steps(readings: FloatArray) -> FloatArray:
    """The same of every column of (n, c), (c,)."""
    return np.array([converter_step(column) for column in readings.T], dtype=np.float64)


def _grid(levels: FloatArray, n: int) -> float:
    """The step of a grid on which all ``levels`` (k,) of ``n`` readings lie, 0 where they lie on none."""
    if len(levels) < 2:
        return 0.0
    gaps = np.diff(levels)
    gaps = gaps[gaps > ARITHMETIC * max(abs(float(levels[0])), abs(float(levels[-1])))]
    if not len(gaps) or (len(gaps) < TESTABLE and n < REPEATS * len(levels)):
        return 0.0
    gaps = gaps[:: -(-len(gaps) // MOST_GAPS)]
    tried = np.unique(np.quantile(gaps, QUANTILES, method="nearest"))[::-1]
    # Two and three steps, never one: what is left of a gap after whole steps is a step too.
    left = np.abs(gaps - tried[-1] * np.rint(gaps / tried[-1]))
    left = left[left > OFF_GRID * tried[-1]]
    rest = [float(left.min())] if len(left) else []
    step = next((step for one in [*tried.tolist(), *rest] if (step := _spacing(gaps, one))), 0.0)
    if not step:
        return 0.0
    step = _refined(levels, step)
    # Counts are whole to the last bit.
    return round(step) if step > 0.5 and np.array_equal(levels, np.rint(levels)) else step


def _refined(levels: FloatArray, step: float) -> float:
    """The step by all levels (k,): what digits have cut off a gap is the less, the further apart two levels are."""
    wide = min(DENSE, len(levels) - 1)
    densest = int(np.argmin(levels[wide:] - levels[: len(levels) - wide]))
    middle = levels[densest + wide // 2]
    reach, widest = REACH, float(np.ptp(levels))
    while True:
        near = levels[np.abs(levels - middle) <= reach * step] - middle
        place = np.rint(near / step)
        if float(np.mean(np.abs(near / step - place) < OFF_GRID)) < ON_GRID:
            return step  # further out the error of the step has grown to its size
        place -= place.mean()
        squares = float(place @ place)
        step = float(place @ near) / squares if squares > 0.0 else step
        if reach * step > widest:
            return step
        reach *= WIDER


def _spacing(gaps: FloatArray, near: float) -> float:
    """The step close to ``near`` of which gaps (k,) are whole multiples; 0 where they are not."""
    is_apart = gaps > WRITTEN * near
    if float(gaps[~is_apart].sum()) > MOST_WRITTEN * near * np.count_nonzero(is_apart):
        return 0.0
    gaps = gaps[is_apart]
    step = near
    for reach in (1.0, 3.0, REACH, REACH):
        whole = np.rint(gaps / step)
        used = (whole >= 1.0) & (whole <= reach)
        if used.any():
            # Written digits cut neighbouring gaps the other way: in the sum they cancel.
            step = float(gaps[used].sum() / whole[used].sum())
    places = gaps / step
    places = places[places < REACH + 0.5]
    n = len(places)
    if n < min(TESTABLE, len(gaps)) or abs(step / near - 1.0) > DRIFT:
        return 0.0
    whole = np.rint(places)
    is_one_apart = bool(np.all(whole == 1.0))
    few = OFF_GRID if n >= TESTABLE or is_one_apart else min(OFF_GRID, 0.5 * BY_CHANCE ** (1.0 / (n - 1)))
    on = (np.abs(places - whole) < few) & (whole > 0.0)
    return step if float(np.mean(on)) >= ON_GRID else 0.0
