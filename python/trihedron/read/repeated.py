"""Repeated readings: channels that are constant throughout, and rows that a log contains twice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.probability import bdtrc
from trihedron.read.errors import ReadError
from trihedron.read.table import Table

TOO_FEW_TO_JUDGE = 20
"""Number of rows below which a working channel may be constant."""


def refuse_constant(table: Table, name: str, triad: FloatArray, where: tuple[int, int, int]) -> None:
    """Refuse readings (n, 3), from columns ``where``, of which an axis is constant.

    Raises
    ------
    ReadError
        When an axis is constant or has no finite reading; the message names the first such column.
    """
    for k, column in enumerate(where):
        head = triad[:1000, k]
        if np.isfinite(head[0]) and np.any(np.isfinite(head) & (head != head[0])):
            continue  # not constant: the other rows need no check
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
"""Rows compared with earlier ones, enough to measure a chance of equal readings of one in ten thousand."""
LAGS = (2, 3, 4, 5)
"""Rows back at which equality by chance is measured: beyond the possible copy, but near enough for the same pose."""
BEYOND_CHANCE = 1e-6
"""p-value below which equal readings with equal timestamps are copies."""
BEYOND_COUNT = 2.0
"""Smallest ratio to the number expected by chance: neighbours are slightly more alike than rows farther apart."""
USUALLY = 0.5
"""If this share of the rows that repeat a timestamp also repeat its readings, all of the latter are copies."""


def copied_rows(
    columns: Sequence[FloatArray], time_s: FloatArray, rows: npt.NDArray[np.signedinteger]
) -> npt.NDArray[np.signedinteger]:
    """Samples (k,) that repeat timestamp and readings of the previous sample more often than by chance.

    ``columns`` are the readings (rows of the table), ``rows`` (n,) the table row of each sample. Samples timestamped on
    arrival share timestamps, and coarse codes in a pose share readings, so two samples may share both. The probability
    that readings are equal by chance is measured two to five samples back, where none can be a copy.
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
    """Whether every reading of these samples equals that of the sample ``lag`` earlier."""
    out = np.ones(len(samples), dtype=bool)
    for values in columns:
        if len(values):
            out &= values[rows[samples]] == values[rows[samples - lag]]
    return out
