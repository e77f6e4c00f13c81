"""A table of numbers from a file, before its columns have roles."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.records import Finding, Onboard, Progress
from trihedron.records.words import Words, words


@dataclass(frozen=True)
class Options:
    """What the user states of a log: see ``trihedron.read``; ``topic`` and ``instance`` choose among several logs in a
    file."""

    columns: str | None = None
    rate_hz: float | None = None
    time_unit: str | None = None
    topic: str | None = None
    instance: str | None = None
    progress: Progress | None = None


@dataclass(frozen=True)
class StatedClock:
    """What a format specifies about its clock; unspecified fields are determined from the numbers.

    ``time``: column of the timestamps; ``unit``: their unit (``s``, ``ms``, ``us``, ``ns`` or ``100us``); ``counter``:
    column that counts samples, lost ones included; ``rate_hz``: the nominal rate, used where there are no timestamps.
    """

    time: int | None = None
    unit: str = ""
    counter: int | None = None
    rate_hz: float | None = None


@dataclass(frozen=True, eq=False)
class Table:
    """Columns (n,) float64 in file order, empty for columns of words; ``names`` is None without a header.

    ``line_of_row`` (n,) is the line of each row; where rows are on consecutive lines it is None and ``first_line`` is
    the first one; for binary formats, where places are given as rows, they are None and 0. ``metadata`` contains keys
    and values of preamble lines. ``words`` is an example cell of each column of words; ``labels`` its distinct words
    and the index (n,) of each row's word, where they are few. From the format: ``sensor`` of columns ``x y z``,
    ``clock`` of the timestamps, ``onboard`` corrections of a flight controller. ``rows_in_file`` counts all rows of the
    file, excluded ones too (0: none is excluded); every excluded row is in a finding's ``rows_left_out``.
    """

    path: Path
    names: tuple[str, ...] | None
    columns: tuple[FloatArray, ...]
    sha256: str = ""
    metadata: dict[str, str] = field(default_factory=dict)
    first_line: int = 0
    line_of_row: IntArray | None = None
    findings: tuple[Finding, ...] = ()
    words: dict[int, str] = field(default_factory=dict)
    labels: dict[int, tuple[tuple[str, ...], IntArray]] = field(default_factory=dict)
    sensor: Literal["accelerometer", "gyroscope"] | None = None
    clock: StatedClock = field(default_factory=StatedClock)
    onboard: Onboard | None = None
    rows_in_file: int = 0
    is_chosen: bool = False
    """The user's choice of topic and instance was already applied when this table was read."""

    @property
    def n_in_file(self) -> int:
        """Number of rows in the file, including rows excluded from this table."""
        return self.rows_in_file or self.n_rows

    def take(self, rows: IntArray, n_in_file: int, *findings: Finding) -> Table:
        """The table of the given rows, in this order; ``n_in_file`` is its number of rows in the file."""
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

    def without(self, columns: set[int]) -> Table:
        """The table without the numbers of some columns, which keep their place."""
        kept = tuple(np.empty(0) if i in columns else column for i, column in enumerate(self.columns))
        return replace(self, columns=kept, rows_in_file=self.n_in_file)

    def by_sensor(
        self, accelerometer: IntArray, gyroscope: IntArray, n_left_out: int, note: Finding
    ) -> tuple[Table, Table]:
        """The tables of the accelerometer's and the gyro's rows; ``n_left_out`` rows, stated in ``note``, are in
        neither."""
        reported = self.n_in_file - self.n_rows
        first = self.take(accelerometer, len(accelerometer) + n_left_out + reported, note)
        second = self.take(gyroscope, len(gyroscope))
        return replace(first, sensor="accelerometer"), replace(second, sensor="gyroscope", findings=())

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        labelled = (len(codes) for _, codes in self.labels.values())
        return max((*(len(column) for column in self.columns), *labelled), default=0)

    def line(self, row: int) -> int:
        """Line of a row in the file; 0 where the format has no lines."""
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
