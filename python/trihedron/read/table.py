"""A table of numbers as a file holds it, before anybody decides what its columns mean."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from trihedron.read.errors import ReadError, from_os_error
from trihedron.records import Finding

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[float, str], None]

BYTES_PER_CELL_AT_PEAK = 24
"""Columns (8 bytes), the sensors' own (n, 3) arrays (8) and one pass of the audit (at most 8)."""


@dataclass(frozen=True)
class StatedClock:
    """What a format itself says of its clock; what it leaves open is found from the numbers.

    ``time``: column of the stamps; ``unit``: theirs (``s``, ``ms``, ``us``, ``ns`` or ``100us``); ``counter``: column
    that counts samples, lost ones included; ``rate_hz``: the nominal rate, used where there are no stamps.
    """

    time: int | None = None
    unit: str = ""
    counter: int | None = None
    rate_hz: float | None = None


@dataclass(frozen=True, eq=False)
class Table:
    """Columns (n,) float64 in file order; ``names`` is None where the file has no header.

    ``line_of_row`` (n,) gives the line of each row, or ``first_line`` alone when rows follow each other without a
    break; both are zero/None for binary formats, where places are counted in rows. ``metadata`` holds key and value of
    preamble lines; ``clock`` is what the format states of its stamps.
    """

    path: Path
    names: tuple[str, ...] | None
    columns: tuple[FloatArray, ...]
    sha256: str = ""
    metadata: dict[str, str] = field(default_factory=dict)
    first_line: int = 0
    line_of_row: npt.NDArray[np.int64] | None = None
    findings: tuple[Finding, ...] = ()
    clock: StatedClock = field(default_factory=StatedClock)

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return max((len(column) for column in self.columns), default=0)

    def line(self, row: int) -> int:
        """Line of the file that holds a row; 0 where the format has no lines."""
        if self.line_of_row is not None:
            return int(self.line_of_row[row])
        return self.first_line + int(row) if self.first_line else 0

    def place(self, row: int) -> str:
        """``line 37`` or, in formats without lines, ``row 37`` (both counted from 1)."""
        line = self.line(row)
        return f"line {line}" if line else f"row {int(row) + 1}"

    def label(self, column: int) -> str:
        """A column's name in quotes, or its number (from 1)."""
        if self.names is not None and self.names[column]:
            return f"'{self.names[column]}'"
        return f"{column + 1}"


def file_sha256(path: Path) -> str:
    """SHA-256 of the bytes of a file, hexadecimal."""
    digest = hashlib.sha256()
    try:
        with path.open("rb") as stream:
            while block := stream.read(1 << 22):
                digest.update(block)
    except OSError as error:
        raise from_os_error(path, error) from None
    return digest.hexdigest()


def available_memory_bytes() -> int | None:
    """Memory this process may still take, or None where the system does not say."""
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except (OSError, ValueError, IndexError):
        return None
    return None


def check_memory(path: Path, n_rows: int, n_columns: int, available: int | None = None, n_held: int = 0) -> None:
    """Refuse a log that would not fit, before it takes the machine down.

    Raises
    ------
    ReadError
        When ``n_rows * n_columns * 24`` bytes, less 8 for every cell of the ``n_held`` rows already read, exceed what
        the machine has left.
    """
    left = available_memory_bytes() if available is None else available
    needed = n_rows * n_columns * BYTES_PER_CELL_AT_PEAK
    if left is not None and needed - 8 * n_held * n_columns > left:
        raise ReadError(
            f"{path}: about {n_rows:.3g} rows of {n_columns} columns need {needed / 1e9:.1f} GB of memory and this "
            f"machine has {left / 1e9:.1f} GB left; cut the log into parts and read them one by one."
        )
