"""Logs larger than memory, whose rows are read on access: of a NumPy array, a Parquet table or a text."""

from __future__ import annotations

import os
import tempfile
import weakref
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.files.output import Temporary, clear_leftovers
from trihedron.read.archive import header
from trihedron.read.errors import (
    ReadError,
    check_readable,
    errors_of_library,
    errors_of_polars,
    errors_of_system,
    first_bytes,
    reject_after_fork,
)
from trihedron.read.text.layout import MISSING, Layout, detect
from trihedron.units import AccelerationUnit, RateUnit

Rows = Callable[[int, int, tuple[int, ...]], npt.NDArray[Any]]
"""Function that reads rows ``[start, stop)`` of some columns as an array (stop - start, columns)."""


def _rows_of_array(path: Path) -> tuple[int, int, Rows]:
    """Numbers of rows and columns of a .npy file, and a function that reads them in the file's data type."""
    damage = "this .npy file is damaged ({}); write it again"
    with errors_of_library(path, damage), errors_of_system(path), path.open("rb") as stream:
        shape, by_columns, dtype = header(stream, path.stat().st_size)
        offset = stream.tell()
    if dtype.kind not in "iuf" or len(shape) != len(("rows", "columns")):
        raise ReadError(f"{path}: only arrays of numbers, rows x columns, are read in pieces; got {dtype} {shape}.")
    n, width = shape

    def taken(stream: Any, first: int, count: int) -> npt.NDArray[Any]:
        stream.seek(offset + first * dtype.itemsize)
        part = np.fromfile(stream, dtype=dtype, count=count)
        if len(part) < count:
            raise ReadError(f"{path}: the file became shorter while it was read; copy it again.")
        return part

    def read(start: int, stop: int, columns: tuple[int, ...]) -> npt.NDArray[Any]:
        with errors_of_system(path), path.open("rb") as stream:
            if by_columns:
                return np.column_stack([taken(stream, k * n + start, stop - start) for k in columns])
            part = taken(stream, start * width, (stop - start) * width).reshape(-1, width)
        return part if columns == tuple(range(width)) else np.ascontiguousarray(part[:, columns])

    return n, width, read


def _rows_of_parquet(path: Path, converted: TextOnDisk | None) -> tuple[int, int, Rows]:
    """As :func:`_rows_of_array`, of a Parquet table, or of that to which a text was ``converted``."""
    import polars

    def table() -> polars.LazyFrame:
        # A converted text is deleted with its object, which stays with this function.
        return polars.scan_parquet(path if converted is None else converted.path)

    with errors_of_polars(path, "this Parquet file is damaged"):
        n_rows = int(table().select(polars.len()).collect().item())
        n_columns = len(table().collect_schema())

    def read(start: int, stop: int, columns: tuple[int, ...]) -> npt.NDArray[Any]:
        with errors_of_polars(path, "this Parquet file is damaged"):
            names = table().collect_schema().names()
            wanted = table().select([names[c] for c in columns])
            part = np.ascontiguousarray(wanted.slice(start, stop - start).collect().to_numpy())
        if len(part) < stop - start or part.dtype.kind not in "iuf":
            raise ReadError(f"{path}: rows {start} to {stop} of this Parquet file are not all numbers; write it again.")
        return part

    return n_rows, n_columns, read


HEAD_BYTES = 1 << 16
"""Bytes from which the layout is detected."""


class TextOnDisk:
    """A Parquet table of a text log's numbers, at ``path`` in the temporary folder; deleted with this object."""

    def __init__(self, log: Path) -> None:
        layout = _layout_of(log)
        folder = Path(tempfile.gettempdir())
        clear_leftovers(folder)
        held = Temporary(folder / f"{log.name}.parquet")
        self._end = weakref.finalize(self, held.__exit__, None, None, None)
        self.path = Path(held.path)
        try:
            _convert(log, layout, self.path)
        except BaseException:
            self._end()
            raise


def _layout_of(log: Path) -> Layout:
    """The layout of a text log."""
    ways = "only .npy, Parquet and plain text tables are read in pieces; write the log as one of these."
    head = first_bytes(log, HEAD_BYTES)
    if b"\0" in head:
        raise ReadError(f"{log}: {ways}")
    text = head.decode("utf-8-sig", errors="replace").replace("\r", "")
    layout = detect(text if len(head) < HEAD_BYTES else text[: text.rfind("\n") + 1])
    if layout is None or layout.separator == " ":
        raise ReadError(f"{log}: {ways} A table's separator is a comma, a semicolon or a tab.")
    if layout.stray or layout.remarks:
        raise ReadError(
            f"{log}: line {(*layout.stray, *layout.remarks)[0]} above the rows is neither names nor a row; remove what "
            "stands there, or read the log whole (without --stream)."
        )
    return layout


def _convert(log: Path, layout: Layout, target: Path) -> None:
    import polars

    reject_after_fork(log)
    names = [f"column {k + 1}" for k in range(layout.n_fields + layout.trailing_separator)]
    remedy = "; repair it, or read the log whole (without --stream), which says which rows"
    with errors_of_polars(log, f"not every row is {layout.n_fields} numbers", remedy):
        try:
            polars.scan_csv(
                log,
                has_header=False,
                schema=dict.fromkeys(names, polars.Float64),
                separator=layout.separator,
                skip_lines=layout.first_line - 1,
                decimal_comma=layout.decimal_comma,
                null_values=[word for word in MISSING if word],
                encoding="utf8",
            ).select(names[: layout.n_fields]).sink_parquet(target, compression="lz4")
        except OSError as error:
            raise ReadError(
                f"{log}: there is no room to make a table of it in {target.parent} ({error.strerror or error}); set "
                "TMPDIR."
            ) from None


ROWS = 1 << 18
ROLES = ("ax", "ay", "az", "gx", "gy", "gz")


@dataclass(frozen=True, eq=False)
class ChunkedLog:
    """A log of ``n_rows`` rows that is read in chunks; ``roles`` name the columns that are read, in file order."""

    path: Path
    n_rows: int
    roles: tuple[str, ...]
    columns: tuple[int, ...]
    read: Rows

    def chunks(self, rows: int = ROWS, first: int = 0) -> Iterator[FloatArray]:
        """Yield arrays (k, columns) in order from row ``first`` on, in the file's data type."""
        for start in range(first, self.n_rows, rows):
            yield self.read(start, min(start + rows, self.n_rows), self.columns)

    def rows(self, start: int, stop: int) -> FloatArray:
        """Rows ``[start, stop)`` as float64 (stop - start, columns)."""
        start, stop = min(max(start, 0), self.n_rows), min(stop, self.n_rows)
        if stop <= start:
            return np.empty((0, len(self.columns)))
        return np.asarray(self.read(start, stop, self.columns), dtype=np.float64)


def open_chunks(path: Path, columns: str) -> ChunkedLog:
    """A NumPy, Parquet or text log with given columns: ``gx,gy,gz,ax,ay,az`` in file order, ``-`` for one not
    read. A text is first converted to a Parquet table in the temporary folder.

    Raises ``ReadError`` when the file has another format, or the columns do not fit it.
    """
    check_readable(path)
    magic = first_bytes(path, 6)
    if magic == b"\x93NUMPY":
        n_rows, n_columns, read = _rows_of_array(path)
    else:
        reject_after_fork(path)
        n_rows, n_columns, read = _rows_of_parquet(path, None if magic[:4] == b"PAR1" else TextOnDisk(path))
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
    return ChunkedLog(path, n_rows, roles, picked, read)


# A log with the attributes of a recording.


@dataclass(frozen=True, eq=False)
class Triad:
    """Three columns of a log on disk as an array (n, 3), whose rows are read on access."""

    log: ChunkedLog
    first: int

    def __len__(self) -> int:
        return self.log.n_rows

    def __getitem__(self, rows: Any) -> FloatArray:
        if isinstance(rows, slice):
            start, stop, step = rows.indices(self.log.n_rows)
            part = self.log.rows(start, stop)[::step]
        else:
            index = np.asarray(rows)
            part = self.log.rows(int(index[0]), int(index[-1]) + 1)[index - index[0]]
        # C order as in a recording, so that sums are bit-identical.
        return np.ascontiguousarray(part[:, self.first : self.first + 3])


@dataclass(frozen=True)
class EvenTime:
    """Timestamps of an even clock as an array (n,), computed on access."""

    n: int
    rate_hz: float

    def __len__(self) -> int:
        return self.n

    def __getitem__(self, rows: Any) -> Any:
        if isinstance(rows, slice):
            return np.arange(*rows.indices(self.n)) / self.rate_hz
        return np.asarray(rows) / self.rate_hz if np.ndim(rows) else float(rows) / self.rate_hz


@dataclass(frozen=True, eq=False)
class LogOnDisk:
    """A log for the segmentation: the attributes of a recording, without its arrays in memory."""

    time_s: EvenTime
    accelerometer: Triad | None
    gyroscope: Triad | None
    rate_hz: float
    accelerometer_unit: AccelerationUnit
    gyroscope_unit: RateUnit
    source: str
    log: ChunkedLog

    @property
    def n_samples(self) -> int:
        """Rows of the log."""
        return self.log.n_rows

    @property
    def duration_s(self) -> float:
        """Time from the first to the last row, plus one sample step, as of a recording."""
        return (self.n_samples - 1) / self.rate_hz + 1.0 / self.rate_hz


def log_on_disk(
    path: str | os.PathLike[str],
    *,
    columns: str,
    rate_hz: float,
    accelerometer_unit: str | AccelerationUnit | None = None,
    gyroscope_unit: str | RateUnit | None = None,
) -> LogOnDisk:
    """A .npy, Parquet or text log whose columns, rate and units are given, not detected.

    Raises ``InputError`` when the file has another format, columns do not fit, or a sensor lacks an axis or the
    order x y z.
    """
    if not (np.isfinite(rate_hz) and rate_hz > 0.0):
        raise InputError(f"--rate is a positive number of samples per second, not {rate_hz}.")
    log = open_chunks(Path(path), columns)
    triads: dict[str, Triad | None] = {"a": None, "g": None}
    for sensor in triads:
        if any(role[0] == sensor for role in log.roles):
            wanted = (f"{sensor}x", f"{sensor}y", f"{sensor}z")
            first = log.roles.index(wanted[0]) if wanted[0] in log.roles else 0
            if log.roles[first : first + 3] != wanted:
                raise InputError(f"{path}: --columns must name {' '.join(wanted)}, one after the other.")
            triads[sensor] = Triad(log, first)
    return LogOnDisk(
        EvenTime(log.n_rows, rate_hz),
        triads["a"],
        triads["g"],
        rate_hz,
        AccelerationUnit(accelerometer_unit or "counts"),
        RateUnit(gyroscope_unit or "counts"),
        str(path),
        log,
    )
