"""Logs larger than memory: rows in pieces, from a NumPy array, a Parquet table or a text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron.read.errors import ReadError, check_readable, from_os_error, refuse_after_fork
from trihedron.read.panics import panics_unprinted
from trihedron.read.rows_on_disk import RowsOnDisk, rows_on_disk
from trihedron.read.text_on_disk import TextOnDisk

ROWS = 1 << 18
ROLES = ("ax", "ay", "az", "gx", "gy", "gz")


@dataclass(frozen=True, eq=False)
class ChunkedLog:
    """A log of ``n_rows`` rows that is read piece by piece; ``roles`` name the columns that are read, in file order."""

    path: Path
    n_rows: int
    roles: tuple[str, ...]
    columns: tuple[int, ...]
    on_disk: RowsOnDisk | None = None
    table: TextOnDisk | None = None
    """Of a text: the table that is read in its place."""

    def chunks(self, rows: int = ROWS, first: int = 0) -> Iterator[npt.NDArray[np.float64]]:
        """Arrays (k, columns) in order from row ``first`` on, in the type of the file."""
        for start in range(first, self.n_rows, rows):
            yield self._part(start, min(start + rows, self.n_rows))

    def rows(self, start: int, stop: int) -> npt.NDArray[np.float64]:
        """Rows ``[start, stop)`` as float64 (stop - start, columns)."""
        if stop <= start:
            return np.empty((0, len(self.columns)))
        return np.asarray(self._part(start, stop), dtype=np.float64)

    def whole(self) -> npt.NDArray[np.float64]:
        """All rows (n, columns)."""
        return self._part(0, self.n_rows)

    def _part(self, start: int, stop: int) -> npt.NDArray[Any]:
        if self.on_disk is not None:
            part = self.on_disk.read(start, stop)
            picked = list(self.columns)
            return part if picked == list(range(part.shape[1])) else np.ascontiguousarray(part[:, picked])
        import polars

        try:
            with panics_unprinted():
                table = polars.scan_parquet(self.path if self.table is None else self.table.path)
                names = table.collect_schema().names()
                wanted = table.select([names[c] for c in self.columns])
                part = np.ascontiguousarray(wanted.slice(start, stop - start).collect().to_numpy())
        except polars.exceptions.PanicException:
            raise ReadError(f"{self.path}: this Parquet file is damaged.") from None
        except polars.exceptions.PolarsError as error:
            raise ReadError(f"{self.path}: this Parquet file is damaged ({str(error).splitlines()[0]}).") from None
        except OSError as error:
            raise from_os_error(self.path, error) from None
        if len(part) < stop - start or part.dtype.kind not in "iuf":
            raise ReadError(
                f"{self.path}: rows {start} to {stop} of this Parquet file are not all numbers; write it again."
            )
        return part


def open_chunks(path: Path, columns: str) -> ChunkedLog:
    """A NumPy, Parquet or text log whose columns are said: ``gx,gy,gz,ax,ay,az`` in file order, ``-`` for one not
    wanted. A text is made a Parquet table first, in the folder for temporary files.

    Raises
    ------
    ReadError
        When the file is none of these, or the columns do not fit it.
    """
    check_readable(path)
    try:
        with path.open("rb") as stream:
            magic = stream.read(6)
    except OSError as error:
        raise from_os_error(path, error) from None
    on_disk = text = None
    if magic == b"\x93NUMPY":
        on_disk = rows_on_disk(path)
        n_rows, n_columns = on_disk.shape
    else:
        import polars

        refuse_after_fork(path)
        text = None if magic[:4] == b"PAR1" else TextOnDisk(path)
        try:
            with panics_unprinted():
                table = polars.scan_parquet(path if text is None else text.path)
                n_rows = int(table.select(polars.len()).collect().item())
                n_columns = len(table.collect_schema())
        except polars.exceptions.PanicException:
            raise ReadError(f"{path}: this Parquet file's description of itself is damaged.") from None
        except polars.exceptions.PolarsError as error:
            raise ReadError(f"{path}: this Parquet file is damaged ({str(error).splitlines()[0]}).") from None
    words = [word.strip().lower() for word in columns.split(",")]
    if len(words) != n_columns:
        raise ReadError(f"{path}: --columns names {len(words)} columns, the file has {n_columns}; '-' leaves one out.")
    unknown = [word for word in words if word not in (*ROLES, "-", "t", "time")]
    if unknown:
        raise ReadError(f"--columns: '{unknown[0]}' is not a role; the roles are {' '.join(ROLES)}, and - for others.")
    picked = tuple(i for i, word in enumerate(words) if word in ROLES)
    roles = tuple(words[i] for i in picked)
    if not picked or len(set(roles)) < len(roles):
        raise ReadError(f"--columns: give each of {' '.join(ROLES)} at most once, and one of them.")
    return ChunkedLog(path, n_rows, roles, picked, on_disk, text)
