"""Storage of a text log's numbers while its blocks are parsed; each number is stored once, in its final place."""

from collections.abc import Iterable, Sequence

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray

_SPARE = 1.02
"""Factor of allocated to expected rows; memory that is never written to is not used."""
_GROWTH = 1.5


class Store:
    """Columns (n,) that grow; the three of a triad are views of one array (n, 3), which then needs no copy.

    ``triads`` are the column numbers of each triad; a column belongs to at most one.
    """

    def __init__(self, n_columns: int, triads: Iterable[Sequence[int]] = ()) -> None:
        self.n_columns, self.n_rows = n_columns, 0
        grouped = [tuple(triad) for triad in triads]
        single = set(range(n_columns)).difference(*grouped)
        self._blocks = [*grouped, *((i,) for i in sorted(single))]
        self._arrays: list[FloatArray] = [np.empty((0, len(block))) for block in self._blocks]
        self._is_numeric = [False] * n_columns

    def append(self, columns: Sequence[FloatArray], expected: int) -> None:
        """Add the next rows (k,) of every column, empty for words; ``expected`` is the expected number of all rows."""
        count = max(len(column) for column in columns)
        need = self.n_rows + count
        for b, block in enumerate(self._blocks):
            if not any(len(columns[i]) for i in block):
                continue
            array = self._with_room(b, need, expected)
            for k, i in enumerate(block):
                if len(columns[i]):
                    array[self.n_rows : need, k] = columns[i]
                    self._is_numeric[i] = True
        self.n_rows = need

    def lend(self, count: int, expected: int) -> tuple[list[tuple[int, int]], list[FloatArray]]:
        """Memory for the next ``count`` rows: ``(block, place)`` of every column, and the blocks (rows, width)."""
        places = {i: (b, k) for b, block in enumerate(self._blocks) for k, i in enumerate(block)}
        need = self.n_rows + count
        blocks = [self._with_room(b, need, expected)[self.n_rows :] for b in range(len(self._blocks))]
        return [places[i] for i in range(self.n_columns)], blocks

    def keep(self, count: int) -> None:
        """Record that ``count`` rows were written to the blocks from :meth:`lend`, with a number in every column."""
        self.n_rows += count
        self._is_numeric = [True] * self.n_columns

    def set_aside(self, column: int) -> bool:
        """Mark a column as words; False, without a change, if it contains a number already."""
        if np.isfinite(self.columns()[column]).any():
            return False
        self._is_numeric[column] = False
        return True

    def _with_room(self, b: int, need: int, expected: int) -> FloatArray:
        """A block with memory for ``need`` rows; if it must grow, for the ``expected`` rows."""
        array = self._arrays[b]
        if len(array) < need:
            grown = _core.new_array(max(need, int(expected * _SPARE), int(len(array) * _GROWTH)), array.shape[1])
            grown[: self.n_rows] = array[: self.n_rows]
            self._arrays[b] = array = grown
        return array

    def columns(self) -> list[FloatArray]:
        """All columns (n,), empty where one contains words; those of a triad are views of one array (n, 3)."""
        out: list[FloatArray] = [np.empty(0)] * self.n_columns
        for block, array in zip(self._blocks, self._arrays, strict=True):
            for k, i in enumerate(block):
                if self._is_numeric[i]:
                    out[i] = array[: self.n_rows, k] if len(block) > 1 else array[: self.n_rows].reshape(-1)
        return out


def side_by_side(columns: Sequence[FloatArray]) -> FloatArray | None:
    """The array (n, 3) of which three columns are views, in this order; None where there is none."""
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
