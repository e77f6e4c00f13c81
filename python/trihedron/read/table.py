"""A table of numbers as a file holds it, before anybody decides what its columns mean."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.read.digest import LateSha256
from trihedron.records import Finding, Onboard
from trihedron.records.words import Words, words


@dataclass(frozen=True)
class StatedClock:
    """What a format itself says of its clock; what it leaves open is found from the numbers.

    ``time``: column of the timestamps; ``unit``: theirs (``s``, ``ms``, ``us``, ``ns`` or ``100us``); ``counter``:
    column that counts samples, lost ones included; ``rate_hz``: the nominal rate, used where there are no timestamps.
    """

    time: int | None = None
    unit: str = ""
    counter: int | None = None
    rate_hz: float | None = None


@dataclass(frozen=True, eq=False)
class Table:
    """Columns (n,) float64 in file order, empty where a column holds words; ``names`` is None without a header.

    ``line_of_row`` (n,) gives the line of each row, or ``first_line`` alone when rows follow each other without a
    break; both are zero/None for binary formats, where places are counted in rows. ``metadata`` holds key and value of
    preamble lines. ``words`` gives an example cell of each column of words, ``labels`` its different words and the word
    (n,) of each row where these are few. What a format knows of itself: ``sensor`` says whose ``x y z`` the columns
    are, ``clock`` what it states of its timestamps. ``onboard`` what a
    flight controller did to the readings. ``rows_in_file`` counts what the file holds, left-out rows
    included (0: as many as there are here); every row that is not here is in a finding's ``rows_left_out``.
    """

    path: Path
    names: tuple[str, ...] | None
    columns: tuple[FloatArray, ...]
    sha256: str | LateSha256 = ""
    metadata: dict[str, str] = field(default_factory=dict)
    first_line: int = 0
    line_of_row: npt.NDArray[np.int64] | None = None
    findings: tuple[Finding, ...] = ()
    words: dict[int, str] = field(default_factory=dict)
    labels: dict[int, tuple[tuple[str, ...], npt.NDArray[np.int64]]] = field(default_factory=dict)
    sensor: Literal["accelerometer", "gyroscope"] | None = None
    clock: StatedClock = field(default_factory=StatedClock)
    onboard: Onboard | None = None
    rows_in_file: int = 0
    is_private: bool = False
    """Its arrays were made by the reader and belong to nobody else: rows may be put in order where they lie."""
    is_chosen: bool = False
    """The user's choice of topic and instance was spent on reading this table."""

    @property
    def n_in_file(self) -> int:
        """Rows that the file holds, those included that are not in this table."""
        return self.rows_in_file or self.n_rows

    def take(self, rows: npt.NDArray[np.int64], n_in_file: int, *findings: Finding) -> Table:
        """Some of the rows, in order, as a table of which the file holds ``n_in_file`` rows."""
        lines = None
        if self.line_of_row is not None:
            lines = self.line_of_row[rows]
        elif self.first_line:
            lines = self.first_line + rows
        return replace(
            self,
            columns=tuple(column[rows] if len(column) else column for column in self.columns),
            labels={i: (words, codes[rows]) for i, (words, codes) in self.labels.items()},
            line_of_row=lines,
            findings=(*self.findings, *findings),
            rows_in_file=n_in_file,
        )

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        labelled = (len(codes) for _, codes in self.labels.values())
        return max((*(len(column) for column in self.columns), *labelled), default=0)

    def line(self, row: int) -> int:
        """Line of the file that holds a row; 0 where the format has no lines."""
        if self.line_of_row is not None:
            return int(self.line_of_row[row])
        return self.first_line + int(row) if self.first_line else 0

    def place(self, row: int) -> Words:
        """``line 37`` or, in formats without lines, ``row 37`` (both counted from 1)."""
        line = self.line(row)
        return words("line", line=line) if line else words("row", row=int(row) + 1)

    def label(self, column: int) -> str:
        """A column's name in quotes, or its number (from 1)."""
        if self.names is not None and self.names[column]:
            return f"'{self.names[column]}'"
        return f"{column + 1}"
