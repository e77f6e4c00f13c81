"""PIPELINE: the stages composed. Everything that a person asks for is one function here, about twenty lines long."""

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


def segment(recording: Recording) -> Segments:
    """Still poses and the moves between them, from the sensor's own noise."""
    raise NotImplementedError(recording)


def calibrate(recording: Recording) -> object:
    """Both sensors from one recording of still poses and moves."""
    raise NotImplementedError(recording)


def apply(recording: Recording) -> Recording:
    """A recording in SI."""
    raise NotImplementedError(recording)


def verify(recording: Recording) -> object:
    """A calibration against another recording."""
    raise NotImplementedError(recording)


def check(recording: Recording) -> object:
    """Is this log fit for calibration?"""
    raise NotImplementedError(recording)
