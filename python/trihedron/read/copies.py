"""Rows that a log holds twice, told from readings that came out alike under one stamp."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.probability import bdtrc

MOST_LOOKED_AT = 100_000
"""Rows at which readings are compared with those farther back: chance as low as one in ten thousand is seen."""
LAGS = (2, 3, 4, 5)
"""How far back: past the row that may be a copy, near enough for the same pose."""
BEYOND_CHANCE = 1e-6
"""p-value below which equal readings under equal timestamps are copies."""
BEYOND_COUNT = 2.0
"""And as many times what chance makes: neighbours are a little more alike than rows farther apart."""
USUALLY = 0.5
"""Share of rows with the timestamp before that repeat its readings too, from which such rows are copies in this log."""


def copied_rows(
    columns: Sequence[FloatArray], time_s: FloatArray, rows: npt.NDArray[np.signedinteger]
) -> npt.NDArray[np.signedinteger]:
    """Samples (k,) whose timestamp and readings are both those of the sample before, where that is no chance.

    ``columns`` hold the readings (rows of the table), ``rows`` (n,) where each sample stands. Samples timestamped on
    arrival share timestamps, and coarse codes of a sensor at rest share readings: both at once are two samples still.
    How often readings agree by chance is seen where nothing can be a copy: two to five samples back.
    """
    again = np.flatnonzero(np.diff(time_s) == 0) + 1
    is_alike = _alike(columns, rows, again, 1)
    n_alike = int(np.count_nonzero(is_alike))
    if n_alike == 0 or n_alike >= USUALLY * len(again):
        return again[is_alike]
    looked_at = again[:: max(len(again) // MOST_LOOKED_AT, 1)]
    looked_at = looked_at[looked_at >= LAGS[-1]]
    seen = sum(int(np.count_nonzero(_alike(columns, rows, looked_at, lag))) for lag in LAGS)
    chance = (seen + 0.5) / (len(looked_at) * len(LAGS) + 1.0)
    is_chance = n_alike <= BEYOND_COUNT * chance * len(again)
    if is_chance or bdtrc(n_alike - 1.0, float(len(again)), chance) > BEYOND_CHANCE:
        return again[:0]
    return again[is_alike]


def _alike(
    columns: Sequence[FloatArray], rows: npt.NDArray[np.signedinteger], samples: npt.NDArray[np.signedinteger], lag: int
) -> npt.NDArray[np.bool_]:
    """Whether every reading of these samples is that of the sample ``lag`` before."""
    out = np.ones(len(samples), dtype=bool)
    for values in columns:
        if len(values):
            out &= values[rows[samples]] == values[rows[samples - lag]]
    return out
