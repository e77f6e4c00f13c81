"""Binary formats, one module each, found automatically.

A file of the format begins with one of its ``STARTS``. ``read(path, options)`` makes one table, or the
accelerometer's and the gyro's; a format that holds several logs reads the chosen one, with ``is_chosen``.
"""

from pathlib import Path

from trihedron.folders import modules_of
from trihedron.read.table import Options, Table


def read_binary(path: Path, first: bytes, options: Options) -> tuple[Table, ...] | None:
    """The tables of a file that begins with ``first``; None for a format that no module reads."""
    module = next((one for one in modules_of(__name__, __path__) if first.startswith(one.STARTS)), None)
    return None if module is None else module.read(path, options)
