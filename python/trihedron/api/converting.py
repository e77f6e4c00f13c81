"""Convert a log of any supported format to CSV, npz or Parquet."""

from __future__ import annotations

import os
from typing import Any

from trihedron.api.reading import read, recording_of
from trihedron.errors import InputError
from trihedron.files.log import write_recording
from trihedron.records import Recording


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
    overwrite : bool
        Replace a file that exists.
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
    recording = read(log, **options) if options else recording_of(log)
    write_recording(recording, output, overwrite=overwrite)
    return recording
