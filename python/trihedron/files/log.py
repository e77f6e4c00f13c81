"""Recordings written as logs that :func:`trihedron.read` takes back without a question: CSV, npz, Parquet."""

from __future__ import annotations

import io
import os
from pathlib import Path

import numpy as np
import polars as pl

from trihedron.files.output import OutputError, write_whole
from trihedron.forked import check_tables
from trihedron.records.recording import FloatArray, Recording

LOG_SUFFIXES = (".csv", ".npz", ".parquet")


def write_recording(recording: Recording, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write time [s], the sensors in their own units, temperature and supply where there are; units in the names.

    Raises
    ------
    OutputError
        When the ending is none of .csv, .npz, .parquet, or the file exists and may not be replaced.
    """
    target = Path(path)
    check_tables()
    columns = _columns(recording)
    suffix = target.suffix.lower()
    buffer = io.BytesIO()
    if suffix == ".csv":
        _frame(columns).write_csv(buffer)
    elif suffix == ".parquet":
        _frame(columns).write_parquet(buffer)
    elif suffix == ".npz":
        np.savez(buffer, allow_pickle=False, **columns)
    else:
        raise OutputError(f"{target}: a log is written as {', '.join(LOG_SUFFIXES)}; give it one of these endings.")
    write_whole(target, buffer.getvalue(), overwrite=overwrite)


def _columns(recording: Recording) -> dict[str, FloatArray]:
    # Nanoseconds: finer digits are rounding of 1/rate, and long in text.
    columns: dict[str, FloatArray] = {"t [s]": np.round(recording.time_s, 9)}
    for letter, sensor, unit in (
        ("a", recording.accelerometer, recording.accelerometer_unit),
        ("g", recording.gyroscope, recording.gyroscope_unit),
    ):
        if sensor is not None:
            columns |= {f"{letter}{axis} [{unit.value}]": sensor[:, k] for k, axis in enumerate("xyz")}
    if recording.temperature_degc is not None:
        columns["temperature [degC]"] = recording.temperature_degc
    if recording.supply_v is not None:
        columns["supply [V]"] = recording.supply_v
    return columns


def _frame(columns: dict[str, FloatArray]) -> pl.DataFrame:
    """Whole numbers as integers: a log of counts reads as one."""
    series = {}
    for name, values in columns.items():
        whole = bool(np.all(np.isfinite(values))) and bool(np.all(values == np.round(values)))
        series[name] = values.astype(np.int64) if whole and not name.startswith("t ") else np.ascontiguousarray(values)
    return pl.DataFrame(series)
