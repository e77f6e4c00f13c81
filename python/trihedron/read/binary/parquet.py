"""Parquet tables, read by polars."""

from pathlib import Path

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.read.errors import ReadError, errors_of_polars, file_sha256, reject_after_fork
from trihedron.read.memory import check_memory
from trihedron.read.table import Options, Table
from trihedron.records import Finding

STARTS = (b"PAR1",)


def read(path: Path, _options: Options) -> tuple[Table, ...]:
    """Numeric and time columns of a Parquet file; other columns are excluded with a finding."""
    reject_after_fork(path)
    # The library for tables is large, and other formats do not need it.
    import polars as pl

    with errors_of_polars(path, "this Parquet file is damaged or cut off", "; write it again"):
        n_rows = pl.scan_parquet(path).select(pl.len()).collect().item()
        check_memory(path, n_rows, len(pl.read_parquet_schema(path)))
        frame = pl.read_parquet(path)
    names: list[str] = []
    columns: list[FloatArray] = []
    findings: list[Finding] = []
    for name, series in zip(frame.columns, frame.get_columns(), strict=True):
        if series.dtype.is_temporal():
            scale = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3}.get(getattr(series.dtype, "time_unit", ""), 1e-9)
            columns.append(np.asarray(series.to_physical().cast(pl.Float64).to_numpy(), dtype=np.float64) * scale)
            names.append(f"{name} [s]")
        elif series.dtype.is_numeric() or series.dtype == pl.Boolean:
            columns.append(np.asarray(series.cast(pl.Float64).to_numpy(), dtype=np.float64))
            names.append(name)
        else:
            findings.append(Finding.of("column-left-out", "type", column=name, kind=str(series.dtype)))
    if not columns or n_rows == 0:
        raise ReadError(f"{path}: the table has no rows of numbers; write it again.")
    return (Table(path, tuple(names), tuple(columns), file_sha256(path), findings=tuple(findings)),)
