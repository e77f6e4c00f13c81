"""Where the numbers of a text log go while its blocks are parsed: each is kept once, where it will be used."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from trihedron.read.table import FloatArray

_SPARE = 1.02
"""Room made beyond the rows expected; memory that is never written to is never taken."""
_GROWTH = 1.5


class Store:
    """Columns (n,) that grow; three that form a triad lie side by side, so that (n, 3) is there without a copy.

    ``triads`` name columns that belong together; a column belongs to one at most.
    """

    def __init__(self, n_columns: int, triads: Iterable[Sequence[int]] = ()) -> None:
        self.n_columns, self.n_rows = n_columns, 0
        grouped = [tuple(triad) for triad in triads]
        single = set(range(n_columns)).difference(*grouped)
        self._blocks = [*grouped, *((i,) for i in sorted(single))]
        self._arrays: list[FloatArray] = [np.empty((0, len(block))) for block in self._blocks]
        self._is_numeric = [False] * n_columns

    def append(self, columns: Sequence[FloatArray], expected: int) -> None:
        """The next rows (k,) of every column, empty where it holds words; ``expected`` rows in all, as far as known."""
        count = max(len(column) for column in columns)
        need = self.n_rows + count
        for b, block in enumerate(self._blocks):
            if not any(len(columns[i]) for i in block):
                continue
            array = self._arrays[b]
            if len(array) < need:
                grown = np.empty((max(need, int(expected * _SPARE), int(len(array) * _GROWTH)), len(block)))
                grown[: self.n_rows] = array[: self.n_rows]
                self._arrays[b] = array = grown
            for k, i in enumerate(block):
                array[self.n_rows : need, k] = columns[i]
                self._is_numeric[i] = True
        self.n_rows = need

    def columns(self) -> list[FloatArray]:
        """All columns (n,), empty where one holds words; those of a triad are views of one (n, 3)."""
        out: list[FloatArray] = [np.empty(0)] * self.n_columns
        for block, array in zip(self._blocks, self._arrays, strict=True):
            for k, i in enumerate(block):
                if self._is_numeric[i]:
                    out[i] = array[: self.n_rows, k] if len(block) > 1 else array[: self.n_rows].reshape(-1)
        return out


def side_by_side(columns: Sequence[FloatArray]) -> FloatArray | None:
    """The (n, 3) array of which three columns are views, in this order; None where they lie elsewhere."""
    first = columns[0]
    base = first.base
    if not isinstance(base, np.ndarray) or base.ndim != 2 or base.shape[1] != len(columns):
        return None
    n = len(first)
    for k, column in enumerate(columns):
        expected = base[:n, k]
        if column.base is not base or len(column) != n or column.strides != expected.strides:
            return None
        if n and column.ctypes.data != expected.ctypes.data:
            return None
    return np.asarray(base[:n], dtype=np.float64)
