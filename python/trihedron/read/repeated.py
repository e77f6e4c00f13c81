"""Repeated readings: channels that are constant throughout, and rows that a log contains twice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.read.errors import ReadError
from trihedron.read.table import Table

TOO_FEW_TO_JUDGE = 20
"""Number of rows below which a working channel may be constant."""


def reject_constant(table: Table, name: str, triad: FloatArray, where: tuple[int, int, int]) -> None:
    """Reject readings (n, 3), from columns ``where``, of which an axis is constant.

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
            raise ReadError(f"{table.path}: column {table.label(column)} of the {name} contains no finite number.")
        if finite[0] == finite[-1] and np.all(finite == finite[0]):
            if table.n_rows < TOO_FEW_TO_JUDGE:
                raise ReadError(
                    f"{table.path}: the file contains {table.n_rows} rows of numbers only, too few for a recording; "
                    "log for a minute or more."
                )
            raise ReadError(
                f"{table.path}: column {table.label(column)} of the {name} is {finite[0]:.6g} in all {len(finite)} "
                f"rows from {table.place(0)} on: a dead channel, or the wrong column; name the columns with --columns."
            )


USUALLY = 0.5
"""Share of the rows with an equal timestamp that must repeat its readings too, so that these are copies."""


def copied_rows(
    columns: Sequence[FloatArray], time_s: FloatArray, rows: npt.NDArray[np.signedinteger]
) -> npt.NDArray[np.signedinteger]:
    """Samples (k,) that repeat timestamp and readings of the previous sample, if most that repeat its timestamp do.

    ``columns`` are the readings (rows of the table), ``rows`` (n,) the table row of each sample. Samples timestamped on
    arrival share timestamps, and coarse codes in a pose share readings, so two samples may share both; seldom most do.
    """
    again = np.flatnonzero(np.diff(time_s) == 0) + 1
    is_alike = np.ones(len(again), dtype=bool)
    for values in columns:
        if len(values):
            is_alike &= values[rows[again]] == values[rows[again - 1]]
    return again[is_alike] if np.count_nonzero(is_alike) >= USUALLY * len(again) else again[:0]
