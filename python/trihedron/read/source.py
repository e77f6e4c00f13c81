"""Any supported file as a table of numbers: the format is told by the first bytes, never by the name."""

from __future__ import annotations

from pathlib import Path

from trihedron.read.archive import read_npy, read_npz
from trihedron.read.errors import ReadError, check_readable, from_os_error
from trihedron.read.table import Progress, Table

_REFUSED = {
    b"\x89HDF": "an HDF5 (or MATLAB 7.3) file",
    b"MATLAB": "a MATLAB file",
    b"#ROSBA": "a ROS bag",
    b"\x89MCAP": "an MCAP file",
    b"ULog": "a ULog file",
    b"SQLite": "a database (or ROS 2 bag)",
    b"%PDF": "a PDF document",
    b"\x28\xb5\x2f\xfd": "zstd-compressed",
    b"\x89PNG": "a picture",
}


def read_table(path: Path, device: int | None = None, progress: Progress | None = None) -> Table:
    """Any supported file as a table of numbers; the format is told by its first bytes, not by its name.

    Raises
    ------
    ReadError
        When the file cannot be read or is no log.
    """
    size = check_readable(path)
    try:
        with path.open("rb") as stream:
            magic = stream.read(8)
    except OSError as error:
        raise from_os_error(path, error) from None
    if magic.startswith(b"\x93NUMPY"):
        return read_npy(path)
    if magic.startswith(b"PK\x03\x04"):
        return read_npz(path, device)
    if device is not None:
        raise ReadError(f"{path}: a device was asked for but this is not an .npz archive; leave --device out.")
    # Tables bring a large library with them, which arrays do not need.
    if magic.startswith(b"PAR1"):
        from trihedron.read.parquet import read_parquet

        return read_parquet(path)
    for start, kind in _REFUSED.items():
        if magic.startswith(start):
            raise ReadError(f"{path}: this is {kind}, which is not read here; export the log as CSV or Parquet.")
    from trihedron.read.text import TextReader, compression_of

    return TextReader(path, compression_of(magic), size, progress).read()
