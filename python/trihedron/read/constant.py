"""Channels without a reading, or with one and the same."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
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
