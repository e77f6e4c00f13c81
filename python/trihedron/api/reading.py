"""Read a log into an audited recording; segment it into poses and moves, or convert it to CSV, npz or Parquet."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

from trihedron.errors import InputError
from trihedron.read import ReadError, read_recording
from trihedron.records import Progress, Recording, Segments, Severity
from trihedron.units import AccelerationUnit, RateUnit

AnyRecording = object
"""A recording, a result with one, or an input of :func:`read`: a file, arrays, a dictionary, a data frame."""
COUNTS_OF_POSES = ("few-poses", "not-static")
"""Findings that already state the number of poses."""
FEWEST_POSES = 3
"""Fewest poses with which a fit is tried."""


def read(
    path: Any = None,
    *,
    accelerometer_path: str | os.PathLike[str] | None = None,
    gyroscope_path: str | os.PathLike[str] | None = None,
    columns: str | None = None,
    rate_hz: float | None = None,
    accelerometer_unit: str | AccelerationUnit | None = None,
    gyroscope_unit: str | RateUnit | None = None,
    time_unit: str | None = None,
    topic: str | None = None,
    instance: int | str | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Read and audit a log: one file, one file per sensor, or readings in memory.

    Without time column and rate, 100 Hz is assumed and reported: serious with a gyro, whose scale is inversely
    proportional to the rate.

    Parameters
    ----------
    path : file, or readings in memory
        Text, ROS bags, PX4, ArduPilot, HDF5, MAT, Parquet, npz and others, recognised by content; or an array
        (n, columns), also structured or masked; a dictionary of arrays (n,) or (n, 3); a list of dictionaries, one per
        sample; a data frame of pandas, polars or Arrow. Masked cells are missing readings. A recording comes back.
    accelerometer_path, gyroscope_path : file
        One file per sensor, each with its own clock; they are merged on a common base. One alone is read alone.
    columns : str
        ``"time=t,ax=3,ay=4,az=5"`` (names, or numbers from 1), or roles in file order ``"t,ax,ay,az,-,gx,gy,gz"``;
        ``time=none`` ignores a time column.
    rate_hz : float
        Sampling rate [Hz] of a log without a time column. A time column has precedence; a contradiction is a finding.
    accelerometer_unit, gyroscope_unit, time_unit : str
        Units, where the detected ones are wrong.
    topic : str
        Which topic, dataset or member of a file with several.
    instance : int or str
        Which of several IMUs in one file.
    progress : callable(share done from 0 to 1, what is being done)

    Returns
    -------
    Recording
        Raw readings on one time base, in the unit of the log, with findings about both.

    Raises
    ------
    ReadError
        (a ``ValueError``) one sentence naming file, line and remedy.

    Examples
    --------
    >>> import numpy as np, trihedron
    >>> rng = np.random.default_rng(1)
    >>> a = rng.normal([0, 0, 9.8], 0.02, (500, 3))
    >>> trihedron.read({"t": np.arange(500) / 100, "acc": a}).rate_hz
    100.0
    """
    inside = getattr(path, "recording", path)
    if isinstance(inside, Recording):
        return inside
    return read_recording(
        path,
        accelerometer_path=accelerometer_path,
        gyroscope_path=gyroscope_path,
        columns=columns,
        rate_hz=rate_hz,
        accelerometer_unit=accelerometer_unit,
        gyroscope_unit=gyroscope_unit,
        time_unit=time_unit,
        topic=topic,
        instance=instance,
        progress=progress,
    )


def recording_of(given: AnyRecording, latitude_deg: float | None = None) -> Recording:
    """A recording: the record itself, that of a result, or one read from an input of :func:`read`; at the latitude of
    its place where that is stated.

    Raises ``InputError`` when it cannot be read, is of another type, or is several recordings.
    """
    if isinstance(given, Recording):
        return given if latitude_deg is None else given.with_same_readings(latitude_deg=latitude_deg)
    if (
        isinstance(given, list | tuple)
        and given
        and all(isinstance(one, Recording | str | os.PathLike) for one in given)
    ):
        raise ReadError(
            f"one recording is taken here, and {len(given)} were given: several of one unit are for "
            "trihedron.calibrate_sessions and trihedron.diagnose_sessions."
        )
    return recording_of(read(given), latitude_deg)


def segments_of(given: Segments | None, recording: Recording, progress: Progress | None = None) -> Segments:
    """Segments as given, or found in the recording.

    Raises ``InputError`` when the given value is not a ``Segments``.
    """
    if given is None:
        return segment(recording, progress=progress)
    if not isinstance(given, Segments):
        raise InputError(f"segments are what trihedron.segment(recording) gives, not {type(given).__name__}.")
    return given


def segment(recording: AnyRecording, *, progress: Progress | None = None) -> Segments:
    """Static poses and the moves between them, separated by the sensor's own noise, without any threshold to set.

    Parameters
    ----------
    recording : Recording, or what trihedron.read takes
        Readings of one or both sensors.
    progress : callable(share done from 0 to 1, what is being done)

    Returns
    -------
    Segments
        ``poses`` and ``moves``, mean reading of every pose (n, 3) in raw units and its standard error.

    Raises
    ------
    ValueError
        When the log cannot be read.

    Examples
    --------
    >>> poses = trihedron.segment(recording)
    >>> poses.accelerometer_mean.shape == (poses.n_poses, 3)
    True
    """
    recording = recording_of(recording)
    # Imported here: it is half of the import time of a command that only reads.
    from trihedron.segment import segment_recording

    return segment_recording(recording, progress=progress)


def convert(log: Any, output: str | os.PathLike[str], *, overwrite: bool = False, **options: Any) -> Recording:
    """Write a log as .csv, .npz or .parquet: time [s], readings in their own unit, temperature and supply.

    Column names state the units, so that the file is read again without options; missing readings are NaN. Time starts
    at 0 s.

    Parameters
    ----------
    log : Recording, or what trihedron.read takes
        What to write.
    output : file
        ``.csv``, ``.npz`` or ``.parquet``.
    overwrite : bool, whether a file that exists is replaced
    options
        Of :func:`trihedron.read`.

    Returns
    -------
    Recording
        What was written.

    Raises
    ------
    ValueError
        When the log cannot be read, or the file cannot be written.

    Examples
    --------
    >>> written = trihedron.convert(recording, "plain.csv", overwrite=True)
    """
    if options and (isinstance(log, Recording) or hasattr(log, "recording")):
        raise InputError(f"{', '.join(options)}: how a log is read cannot be said of one that was read already.")
    # Imported here: a verb that only reads does not need it.
    from trihedron.files.log import write_recording

    recording = read(log, **options) if options else recording_of(log)
    write_recording(recording, output, overwrite=overwrite)
    return recording


def accelerometer_only(recording: Recording, segments: Segments) -> tuple[Recording, Segments]:
    """The recording and its segments without the gyroscope."""
    bare = replace(segments, gyroscope_sigma=None, gyroscope_mean=None, gyroscope_sigma_mean=None)
    return replace(recording, gyroscope=None), bare


def require_poses(recording: Recording, segments: Segments) -> None:
    if recording.accelerometer is None:
        raise InputError(
            f"{recording.source}: a gyro alone cannot be calibrated by gravity; log the accelerometer as well, "
            "or name its columns with --columns."
        )
    if segments.n_poses < FEWEST_POSES:
        of_log = [one for one in recording.findings if one.severity is Severity.SERIOUS]
        grave = next((one for one in (*of_log, *segments.findings) if one.severity is not Severity.NOTE), None)
        is_count = grave is not None and grave.code in COUNTS_OF_POSES
        why = [] if is_count else [f"Poses found: {segments.n_poses}."]
        if grave is not None:
            why += [grave.seen, grave.action] if of_log else [grave.seen]
            why += [grave.cause] if grave.code == "not-static" else []
        if grave is None or grave.code != "rate-contradicted":
            why.append("Hold the sensor still for 3 to 5 seconds in each of 18 or more different poses;")
            why.append("`trihedron segment LOG` shows what was seen.")
        raise InputError(f"{recording.source}: {' '.join(why)}")
