"""Parquet tables, read by polars."""

from dataclasses import replace
from pathlib import Path

from trihedron.read.errors import errors_of_polars, file_sha256, reject_after_fork
from trihedron.read.memory import check_memory, columns_table, frame_columns
from trihedron.read.table import Options, Table

STARTS = (b"PAR1",)


def read(path: Path, _options: Options) -> tuple[Table, ...]:
    """The columns of a Parquet file, as those of a data frame in memory."""
    reject_after_fork(path)
    # The library for tables is large, and other formats do not need it.
    import polars as pl

    with errors_of_polars(path, "this Parquet file is damaged or cut off", "; write it again"):
        n_rows = pl.scan_parquet(path).select(pl.len()).collect().item()
        check_memory(path, n_rows, len(pl.read_parquet_schema(path)))
        # Times of day as their time since midnight.
        frame = pl.read_parquet(path).with_columns(pl.col(pl.Time).cast(pl.Duration))
    return (replace(columns_table(str(path), frame_columns(frame), file_sha256(path)), path=path),)
