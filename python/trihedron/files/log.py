"""Recordings written as tables that :func:`trihedron.read` reads without options, and the truth of simulated ones."""

import io
import json
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from trihedron.arrays import AXES, FloatArray
from trihedron.files.output import OutputError, write_whole
from trihedron.records.recording import Recording
from trihedron.records.truth import Truth
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


# The truth of a simulated log in a separate file: .npz with a JSON header, or the header alone as .json.

_ARRAYS = (
    "accelerometer_time_s",
    "gyroscope_time_s",
    "specific_force_m_s2",
    "angular_rate_rad_s",
    "attitude",
    "temperature_degc",
    "supply_v",
    "kept",
)
_MATRICES = ("accelerometer_S", "accelerometer_b", "gyroscope_S", "gyroscope_b")


def truth_document(truth: Truth) -> dict[str, Any]:
    """The truth without the arrays per sample, as plain JSON types (SI)."""
    return {
        "scenario": truth.scenario,
        "seed": truth.seed,
        "gravity_m_s2": truth.gravity_m_s2,
        **{name: getattr(truth, name).tolist() for name in _MATRICES},
        "effects": {name: dict(values) for name, values in truth.effects.items()},
        "noise": {name: dict(values) for name, values in truth.noise.items()},
        "segments": [asdict(segment) for segment in truth.segments],
    }


def check_truth_suffix(path: Path) -> None:
    """Reject a file name whose ending is not that of a format, before any work."""
    if path.suffix.lower() not in (".npz", ".json"):
        raise OutputError(f"{path}: truth is written as .npz (everything) or .json (no samples).")


def write_truth(truth: Truth, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the truth; ``.npz`` contains everything, ``.json`` all but the arrays per sample.

    Raises ``InputError`` when the ending is another one, or the file exists and may not be replaced.
    """
    target = Path(path)
    check_truth_suffix(target)
    text = json.dumps(truth_document(truth), indent=1)
    if target.suffix.lower() == ".json":
        write_whole(target, text + "\n", overwrite=overwrite)
    else:
        arrays = {name: getattr(truth, name) for name in _ARRAYS if getattr(truth, name) is not None}
        buffer = io.BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, header=np.array(text), **arrays)
        write_whole(target, buffer.getvalue(), overwrite=overwrite)
