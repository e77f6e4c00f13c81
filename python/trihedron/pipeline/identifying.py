"""Noise of a static log: identified from a recording, or from a file read in pieces."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from trihedron.estimate.noise.grid import readings_of
from trihedron.estimate.noise.identify import identify_noise
from trihedron.estimate.noise.streamed import stream_noise
from trihedron.read.chunks import open_chunks
from trihedron.records import Noise, Recording
from trihedron.units import AccelerationUnit, RateUnit, acceleration_to_si, rate_to_si

IN_MEMORY_BYTES = 1 << 29
"""A log up to this size is taken whole even when it is read in pieces: events can then be found and left out."""


def noise(
    recording: Recording,
    *,
    exclude_s: Sequence[tuple[float, float]] = (),
    automatic: bool = True,
    clusters: Sequence[int] | None = None,
) -> Noise:
    """Noise terms of every axis of a static recording, in SI units where the log tells them (docs/noise.md).

    Raises
    ------
    ValueError
        When the log is too short or has too many gaps; one sentence says why and what to do.
    """
    readings, names, units = readings_of(recording)
    found = identify_noise(
        readings,
        recording.rate_hz,
        names=names,
        units=units,
        exclude_s=exclude_s,
        automatic=automatic,
        clusters=clusters,
        source=recording.source,
    )
    # What the log is said to be comes before what its noise is.
    return replace(found, findings=(*recording.findings, *found.findings))


def noise_of_file(
    path: str | os.PathLike[str],
    *,
    columns: str,
    rate_hz: float,
    accelerometer_unit: str | AccelerationUnit | None = None,
    gyroscope_unit: str | RateUnit | None = None,
    exclude_s: Sequence[tuple[float, float]] = (),
    automatic: bool = True,
) -> Noise:
    """Noise of a .npy or Parquet log of any size in bounded memory; what its columns are is said, not judged.

    Up to half a gigabyte the log is mapped whole; beyond, it is read in one pass (:func:`stream_noise`), which leaves
    nothing out.

    Raises
    ------
    ValueError
        When the file cannot be read in pieces, the columns do not fit, or stretches are to be left out of a stream.
    """
    log = open_chunks(Path(path), columns)
    factor, names, units = [], [], []
    for role in log.roles:
        if role[0] == "g":
            rate_unit = RateUnit(gyroscope_unit or "counts")
            printed, scale, si = rate_unit.value, rate_to_si(rate_unit), "rad/s"
        else:
            force_unit = AccelerationUnit(accelerometer_unit or "counts")
            printed, scale, si = force_unit.value, acceleration_to_si(force_unit), "m/s^2"
        names.append(f"{'gyro' if role[0] == 'g' else 'accel'} {role[1]}")
        units.append(printed if scale is None else si)
        factor.append(1.0 if scale is None else scale)
    scales = np.array(factor)
    is_scaled = bool(np.any(scales != 1.0))

    def scaled(part: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return part * scales if is_scaled else part

    if 8 * log.n_rows * len(log.roles) <= IN_MEMORY_BYTES:
        return identify_noise(
            scaled(log.whole()),
            rate_hz,
            names=names,
            units=units,
            exclude_s=exclude_s,
            automatic=automatic,
            source=str(path),
        )
    if exclude_s:
        raise ValueError(f"{path}: nothing can be left out of a log that is read in one pass; cut the file instead.")

    def parts() -> Iterator[npt.NDArray[np.float64]]:
        for part in log.chunks():
            yield scaled(part)

    return stream_noise(parts(), rate_hz, n_samples=log.n_rows, names=names, units=units, source=str(path))
