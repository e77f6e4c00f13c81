"""A recording written as a table that any program reads, this one included."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

from trihedron.files.output import OutputError, write_whole
from trihedron.forked import check_tables
from trihedron.records import Recording

ACCELEROMETER_NAMES = ("acc_x", "acc_y", "acc_z")
GYROSCOPE_NAMES = ("gyr_x", "gyr_y", "gyr_z")
FORMATS = (".csv", ".parquet")


def check_format(path: str | os.PathLike[str]) -> None:
    """Refuse a name whose ending tells no format, before the work.

    Raises
    ------
    OutputError
        Naming the endings there are.
    """
    if str(path) != "-" and Path(path).suffix.lower() not in FORMATS:
        raise OutputError(f"{path}: a recording is written as .csv or .parquet; give one of these endings.")


def write_recording(recording: Recording, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write ``time_s``, ``acc_x … acc_z``, ``gyr_x … gyr_z`` with all digits; ``-`` is CSV on stdout.

    Raises
    ------
    OutputError
        When the ending names no format, or as :func:`trihedron.files.output.write_whole`.
    """
    check_format(path)
    check_tables()
    # Imported here: it costs more than the rest of a short run.
    import polars

    target = Path(path)
    kind = target.suffix.lower()
    to_stdout = str(path) == "-"
    columns = {"time_s": recording.time_s}
    for names, readings in ((ACCELEROMETER_NAMES, recording.accelerometer), (GYROSCOPE_NAMES, recording.gyroscope)):
        if readings is not None:
            columns |= {name: readings[:, k] for k, name in enumerate(names)}
    frame = polars.DataFrame(columns)
    if to_stdout:
        sys.stdout.write(frame.write_csv())
        return
    buffer = io.BytesIO()
    if kind == ".csv":
        frame.write_csv(buffer)
    else:
        frame.write_parquet(buffer)
    write_whole(target, buffer.getvalue(), overwrite=overwrite)
