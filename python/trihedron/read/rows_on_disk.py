"""Rows of a .npy file, read where they lie: a mapped file that somebody shortens would end the process."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron.errors import RefusedError
from trihedron.read.archive import DAMAGE, header
from trihedron.read.errors import ReadError, from_os_error


@dataclass(frozen=True, eq=False)
class RowsOnDisk:
    """An array (n, k) of numbers in a file; ``by_columns`` says that it lies column after column."""

    path: Path
    shape: tuple[int, int]
    dtype: np.dtype[Any]
    offset: int
    by_columns: bool

    def read(self, start: int, stop: int) -> npt.NDArray[Any]:
        """Rows ``[start, stop)`` (stop - start, k) in the type of the file.

        Raises
        ------
        ReadError
            When the file became shorter, or the system cannot read it.
        """
        n, width = self.shape
        start, stop = min(max(start, 0), n), min(stop, n)
        rows = max(stop - start, 0)
        try:
            with self.path.open("rb") as stream:
                if not self.by_columns:
                    return self._taken(stream, start * width, rows * width).reshape(rows, width)
                out = np.empty((rows, width), self.dtype)
                for k in range(width):
                    out[:, k] = self._taken(stream, k * n + start, rows)
                return out
        except OSError as error:
            raise from_os_error(self.path, error) from None

    def _taken(self, stream: Any, first: int, count: int) -> npt.NDArray[Any]:
        stream.seek(self.offset + first * self.dtype.itemsize)
        part = np.fromfile(stream, dtype=self.dtype, count=count)
        if len(part) < count:
            raise ReadError(f"{self.path}: the file became shorter while it was read; copy it again.")
        return part


def rows_on_disk(path: Path) -> RowsOnDisk:
    """The rows of a .npy file.

    Raises
    ------
    ReadError
        When the file is damaged, or its array is no table of numbers.
    """
    try:
        with path.open("rb") as stream:
            shape, by_columns, dtype = header(stream)
            offset = stream.tell()
            if min(shape, default=1) < 0 or dtype.itemsize * math.prod(shape) != path.stat().st_size - offset:
                raise RefusedError(f"its header says {dtype} of shape {shape}, and it has another length")
    except OSError as error:
        raise from_os_error(path, error) from None
    except DAMAGE as error:
        why = (str(error).splitlines() or [type(error).__name__])[0]
        raise ReadError(f"{path}: this .npy file is damaged ({why}); write it again.") from None
    if dtype.kind not in "iuf" or len(shape) != len(("rows", "columns")):
        raise ReadError(f"{path}: only arrays of numbers, rows x columns, are read in pieces; got {dtype} {shape}.")
    return RowsOnDisk(path, (shape[0], shape[1]), dtype, offset, by_columns)
