"""Logs larger than memory: rows in pieces, from a memory-mapped NumPy array or a Parquet table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from trihedron.read.errors import ReadError, check_readable, from_os_error
from trihedron.read.panics import panics_unprinted

ROWS = 1 << 18
ROLES = ("ax", "ay", "az", "gx", "gy", "gz")


@dataclass(frozen=True, eq=False)
class ChunkedLog:
    """A log of ``n_rows`` rows that is read piece by piece; ``roles`` name the columns that are read, in file order."""

    path: Path
    n_rows: int
    roles: tuple[str, ...]
    columns: tuple[int, ...]
    array: npt.NDArray[np.float64] | None = None

    def chunks(self, rows: int = ROWS) -> Iterator[npt.NDArray[np.float64]]:
        """Arrays (k, columns) in order, in the type of the file."""
        picked = list(self.columns)
        if self.array is not None:
            everything = picked == list(range(self.array.shape[1]))
            for part in _pieces(self.path, self.array, rows):
                yield np.ascontiguousarray(part if everything else part[:, picked])
            return
        import polars

        table = polars.scan_parquet(self.path)
        names = table.collect_schema().names()
        wanted = table.select([names[c] for c in picked])
        for start in range(0, self.n_rows, rows):
            yield np.ascontiguousarray(wanted.slice(start, rows).collect().to_numpy())

    def rows(self, start: int, stop: int) -> npt.NDArray[np.float64]:
        """Rows ``[start, stop)`` as float64 (stop - start, columns)."""
        if stop <= start:
            return np.empty((0, len(self.columns)))
        if self.array is not None:
            return np.array(self.array[start:stop][:, list(self.columns)], dtype=np.float64)
        import polars

        table = polars.scan_parquet(self.path)
        names = table.collect_schema().names()
        part = table.select([names[c] for c in self.columns]).slice(start, stop - start).collect()
        return np.asarray(part.to_numpy(), dtype=np.float64)

    def whole(self) -> npt.NDArray[np.float64]:
        """All rows (n, columns): the mapped array itself where its columns are all wanted."""
        if self.array is not None and list(self.columns) == list(range(self.array.shape[1])):
            return self.array
        return np.concatenate(list(self.chunks()))


def _pieces(path: Path, array: npt.NDArray[np.float64], rows: int) -> Iterator[npt.NDArray[np.float64]]:
    """Rows of a mapped array, read rather than mapped: pages once mapped would count as memory until the end."""
    if not (isinstance(array, np.memmap) and array.flags.c_contiguous):
        for start in range(0, len(array), rows):
            yield array[start : start + rows]
        return
    width = array.shape[1]
    with path.open("rb") as stream:
        stream.seek(array.offset)
        for start in range(0, len(array), rows):
            count = min(rows, len(array) - start)
            part = np.fromfile(stream, dtype=array.dtype, count=count * width)
            if len(part) < count * width:
                raise ReadError(f"{path}: the file became shorter while it was read; copy it again.")
            yield part.reshape(count, width)


def open_chunks(path: Path, columns: str) -> ChunkedLog:
    """A NumPy or Parquet log whose columns are said: ``gx,gy,gz,ax,ay,az`` in file order, ``-`` for one not wanted.

    Raises
    ------
    ReadError
        When the file is neither, or the columns do not fit it.
    """
    check_readable(path)
    try:
        with path.open("rb") as stream:
            magic = stream.read(6)
    except OSError as error:
        raise from_os_error(path, error) from None
    array = None
    if magic == b"\x93NUMPY":
        try:
            array = np.load(path, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError, EOFError, SyntaxError) as error:
            raise ReadError(f"{path}: this .npy file is damaged ({error}); write it again.") from None
        if array.ndim != 2 or array.dtype.kind not in "iuf":
            raise ReadError(f"{path}: only arrays of numbers, rows x columns, are read in pieces; got {array.shape}.")
        n_rows, n_columns = array.shape
    elif magic[:4] == b"PAR1":
        import polars

        try:
            with panics_unprinted():
                table = polars.scan_parquet(path)
                n_rows = int(table.select(polars.len()).collect().item())
                n_columns = len(table.collect_schema())
        except polars.exceptions.PanicException:
            raise ReadError(f"{path}: this Parquet file's description of itself is damaged.") from None
        except polars.exceptions.PolarsError as error:
            raise ReadError(f"{path}: this Parquet file is damaged ({str(error).splitlines()[0]}).") from None
    else:
        raise ReadError(f"{path}: only .npy and Parquet files are read in pieces; write the log as one of these.")
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
    return ChunkedLog(path, n_rows, roles, picked, array)
