"""The LSB, from the values that occur: the only place that looks for it."""

from __future__ import annotations

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray

PROBED = 1 << 14
"""Readings, evenly spread over a channel, whose values are looked at: sorting them takes half a millisecond."""
TESTABLE = 8
"""Gaps within reach, of many, that are evidence (``rust/adc_grid.rs``, where the grid's own limits stand)."""
REPEATS = 2
"""Readings must repeat where they are few, so many times a value."""
PARTS = 8
"""Where the whole log has no grid its parts may: a range was changed, or another sensor took over."""


def probe(readings: FloatArray) -> FloatArray:
    """The readings (k, ...) of (n, ...) that are looked at."""
    out: FloatArray = readings[:: probe_stride(len(readings))]
    return out


def probe_stride(n: int) -> int:
    """Every which of n readings is looked at."""
    return max(1, -(-n // PROBED))


def adc_step(readings: FloatArray) -> float:
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


def adc_steps(readings: FloatArray) -> FloatArray:
    """The same of every column of (n, c), (c,)."""
    return np.array([adc_step(column) for column in readings.T], dtype=np.float64)


def _grid(levels: FloatArray, n: int) -> float:
    """The step of a grid on which all ``levels`` (k,) of ``n`` readings lie, 0 where they lie on none."""
    return _core.adc_grid(levels, n) or 0.0
