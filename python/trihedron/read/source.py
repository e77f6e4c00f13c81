"""Any supported file as tables of numbers: the format is told by the first bytes, never by the name."""

from __future__ import annotations

from pathlib import Path

from trihedron.read.archive import read_npy
from trihedron.read.devices import Choice, by_sensor
from trihedron.read.errors import ReadError, check_readable, from_os_error
from trihedron.read.refused import refuse_foreign
from trihedron.read.table import Progress, Table
from trihedron.read.zipped import read_zip


def read_table(path: Path, device: int | None = None, progress: Progress | None = None) -> Table:
    """The one table of a file.

    Raises
    ------
    ReadError
        When the file cannot be read, is no log, or holds one table per sensor.
    """
    tables = read_tables(path, Choice(device=device), progress)
    if len(tables) > 1:
        raise ReadError(f"{path}: the file holds one table per sensor, and one table is wanted here.")
    return tables[0]


def read_tables(path: Path, choice: Choice, progress: Progress | None = None) -> tuple[Table, ...]:
    """One table, or the accelerometer's and the gyro's (in this order) where each has its own clock.

    Raises
    ------
    ReadError
        When the file cannot be read or is no log, or offers several devices of which none was chosen.
    """
    size = check_readable(path)
    try:
        with path.open("rb") as stream:
            magic = stream.read(512)
    except OSError as error:
        raise from_os_error(path, error) from None
    if magic.startswith(b"\x93NUMPY"):
        return (read_npy(path),)
    if magic.startswith(b"PK\x03\x04"):
        return read_zip(path, choice, progress)
    if choice.device is not None:
        raise ReadError(f"{path}: a device was asked for but this is not an .npz archive; leave --device out.")
    # Tables bring a large library with them, which arrays do not need.
    if magic.startswith(b"PAR1"):
        from trihedron.read.parquet import read_parquet

        return by_sensor(read_parquet(path))
    refuse_foreign(path, magic)
    from trihedron.read.text import compression_of, read_text

    tables = read_text(path, compression_of(magic), size, progress)
    return by_sensor(tables[0]) if len(tables) == 1 else tables
