"""What repeats: a channel that reads the same throughout, rows that a log holds twice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.probability import bdtrc
from trihedron.read.errors import ReadError
from trihedron.read.table import Table

TOO_FEW_TO_JUDGE = 20
"""Rows in which a live channel may well read the same throughout."""


def refuse_constant(table: Table, name: str, triad: FloatArray, where: tuple[int, int, int]) -> None:
    """Readings (n, 3) of which an axis never changes, from columns ``where``.

    Raises
    ------
    ReadError
        Naming the first such column.
    """
    for k, column in enumerate(where):
        head = triad[:1000, k]
        if np.isfinite(head[0]) and np.any(np.isfinite(head) & (head != head[0])):
            continue  # it changes: no need to go through millions of rows
        finite = triad[np.isfinite(triad[:, k]), k]
        if len(finite) == 0:
            raise ReadError(f"{table.path}: column {table.label(column)} of the {name} holds no finite number.")
        if finite[0] == finite[-1] and np.all(finite == finite[0]):
            if table.n_rows < TOO_FEW_TO_JUDGE:
                raise ReadError(
                    f"{table.path}: the file holds {table.n_rows} rows of numbers only, too few for a recording; log "
                    "for a minute or more."
                )
            raise ReadError(
                f"{table.path}: column {table.label(column)} of the {name} is {finite[0]:.6g} in all {len(finite)} "
                f"rows from {table.place(0)} on: a dead channel, or the wrong column; name the columns with --columns."
            )


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
