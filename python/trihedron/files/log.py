"""Recordings written as tables that :func:`trihedron.read` reads without options: CSV, npz, Parquet."""

import io
import os
import sys
from pathlib import Path

import numpy as np
import polars as pl

from trihedron.arrays import AXES, FloatArray
from trihedron.files.output import OutputError, write_whole
from trihedron.records.recording import Recording
from trihedron.subprocesses import check_tables

LOG_SUFFIXES = (".csv", ".npz", ".parquet")
_TIME = "t [s]"


def check_suffix(path: str | os.PathLike[str]) -> None:
    """Reject a file name whose ending is not that of a format, before any work; the message lists the valid ones."""
    if Path(path).suffix.lower() not in LOG_SUFFIXES:
        raise OutputError(f"{path}: a log is written as {', '.join(LOG_SUFFIXES)}; give it one of these endings.")


def write_recording(recording: Recording, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write time [s] from the log's own origin, the readings in raw units, and every other column; units in the names.

    ``-`` is CSV on stdout.

    Raises ``InputError`` when the ending is none of .csv, .npz, .parquet, or the file exists and may not be
    replaced.
    """
    if str(path) != "-":
        check_suffix(path)
    check_tables()
    columns = _columns(recording)
    if str(path) == "-":
        sys.stdout.write(_frame(columns).write_csv())
        return
    target = Path(path)
    suffix = target.suffix.lower()
    buffer = io.BytesIO()
    if suffix == ".csv":
        _frame(columns).write_csv(buffer)
    elif suffix == ".parquet":
        _frame(columns).write_parquet(buffer)
    else:
        np.savez(buffer, allow_pickle=False, **columns)
    write_whole(target, buffer.getvalue(), overwrite=overwrite)


def _columns(recording: Recording) -> dict[str, FloatArray]:
    # Rounded to nanoseconds: finer digits are the rounding of 1/rate and lengthen the text.
    columns: dict[str, FloatArray] = {_TIME: np.round(recording.start_epoch_s + recording.time_s, 9)}
    for letter, sensor, unit in (
        ("a", recording.accelerometer, recording.accelerometer_unit),
        ("g", recording.gyroscope, recording.gyroscope_unit),
    ):
        if sensor is not None:
            columns |= {f"{letter}{axis} [{unit.value}]": sensor[:, k] for k, axis in enumerate(AXES)}
    columns |= recording.auxiliary
    if recording.temperature_degc is not None:
        columns["temperature [degC]"] = recording.temperature_degc
    if recording.supply_v is not None:
        columns["supply [V]"] = recording.supply_v
    return columns


def _frame(columns: dict[str, FloatArray]) -> pl.DataFrame:
    """The columns as a table; whole numbers are integers, so that a log of counts is read as counts."""
    series = {}
    for name, values in columns.items():
        whole = bool(np.all(np.isfinite(values))) and bool(np.all(values == np.round(values)))
        series[name] = values.astype(np.int64) if whole and name != _TIME else np.ascontiguousarray(values)
    return pl.DataFrame(series)
