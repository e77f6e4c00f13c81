"""Log in, audited recording out; recording in, still poses out."""

from __future__ import annotations

import os
from collections.abc import Callable

from trihedron.read import read_recording
from trihedron.records import Recording, Segments
from trihedron.units import AccelerationUnit, RateUnit

Progress = Callable[[float, str], None]


def read(
    path: str | os.PathLike[str] | None = None,
    *,
    accelerometer_path: str | os.PathLike[str] | None = None,
    gyroscope_path: str | os.PathLike[str] | None = None,
    columns: str | None = None,
    rate_hz: float | None = None,
    accelerometer_unit: str | AccelerationUnit | None = None,
    gyroscope_unit: str | RateUnit | None = None,
    time_unit: str | None = None,
    device: int | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Read and audit a log; the parameters are those of :func:`trihedron.read.read_recording`.

    Raises
    ------
    ReadError
        (a ``ValueError``) one sentence naming file, line and remedy.
    """
    return read_recording(
        path,
        accelerometer_path=accelerometer_path,
        gyroscope_path=gyroscope_path,
        columns=columns,
        rate_hz=rate_hz,
        accelerometer_unit=accelerometer_unit,
        gyroscope_unit=gyroscope_unit,
        time_unit=time_unit,
        device=device,
        progress=progress,
    )


def segment(recording: Recording, *, progress: Progress | None = None) -> Segments:
    """Still poses and the moves between them, told apart by the sensor's own noise: nothing to set."""
    # Loaded when it is needed: half of what a command that only reads would wait for.
    from trihedron.segment import segment_recording

    return segment_recording(recording, progress=progress)
