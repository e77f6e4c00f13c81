"""A log on disk with the attributes of a recording, whose rows are read on access."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.read.chunks import ChunkedLog, open_chunks
from trihedron.units import AccelerationUnit, RateUnit


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
