"""Cells of a block of text as numbers, dates or words, parsed by polars."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.read.errors import ReadError, errors_of_polars
from trihedron.read.names import parse_name
from trihedron.read.text.dates import form_of, seconds
from trihedron.read.text.layout import MISSING, Layout

if TYPE_CHECKING:
    import polars as pl

# polars is imported where it is used: the import takes longer than reading a short log, and most logs do not need it.

_PLAIN = re.compile(r"-?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?").fullmatch
"""A number in every convention."""
MAX_WORDS = 64
"""Largest number of distinct words of a column that may identify sensors or devices; with more it is text."""


@dataclass
class TextColumn:
    """A column without numbers: ``form`` of its dates or "", and the distinct ``words`` so far, in order."""

    example: str
    form: str = ""
    words: dict[str, int] = field(default_factory=dict)
    codes: list[IntArray] = field(default_factory=list)

    def encode(self, cells: pl.Series) -> None:
        """Store the index of each row's word, unless there are too many words for labels."""
        import polars as pl

        if len(self.words) > MAX_WORDS:
            return
        text = cells.fill_null("").str.strip_chars(' "')
        for word in text.unique(maintain_order=True):
            self.words.setdefault(word, len(self.words))
        if len(self.words) > MAX_WORDS:
            self.codes.clear()
            return
        mapped = text.replace_strict(list(self.words), list(self.words.values()), return_dtype=pl.Int64)
        self.codes.append(np.asarray(mapped.to_numpy(), dtype=np.int64))


def find_text_columns(rows: list[list[str]], layout: Layout) -> dict[int, TextColumn]:
    """Columns that contain words or dates instead of numbers, determined from the first rows."""
    columns = {i: [r[i] for r in rows] for i in range(layout.n_fields)}
    columns = {i: cells for i, cells in columns.items() if layout.decimal_comma or not all(map(_PLAIN, cells))}
    found: dict[int, TextColumn] = {}
    if not rows or not columns:
        return found
    import polars as pl

    for i, column in columns.items():
        series = pl.Series(column, dtype=pl.String)
        are_words = _words(series, layout.decimal_comma)
        if are_words.sum() > 0.5 * len(rows):
            cells = series.filter(are_words)
            found[i] = TextColumn(cells[0], form_of(cells) or "")
    return found


def parse(
    path: Path, data: bytes, schema: Mapping[str, type[pl.DataType]], layout: Layout, first_line: int
) -> pl.DataFrame:
    """A block as a frame; cells that do not fit their column's type are null.

    Raises ``ReadError`` when the block is not a table.
    """
    import polars as pl

    with errors_of_polars(path, f"the text from line {first_line} on cannot be read as a table"):
        return pl.read_csv(
            io.BytesIO(data),
            has_header=False,
            separator=layout.separator,
            schema=schema,
            ignore_errors=True,
            truncate_ragged_lines=True,
            quote_char='"' if b'"' in data else None,
            decimal_comma=layout.decimal_comma,
            encoding="utf8-lossy",
        )


def reject_words(path: Path, frame: pl.DataFrame, as_text: pl.DataFrame, lines: IntArray, layout: Layout) -> None:
    """Reject cells that are neither numbers nor words for "missing", which are NaN.

    Raises ``ReadError`` when there is such a cell; the message names line, column and content of the first.
    """
    first: tuple[int, int, str] | None = None
    for name in as_text.columns:
        text = as_text[name].fill_null("").str.strip_chars()
        bad = frame[name].is_null() & ~text.str.to_lowercase().is_in(list(MISSING))
        row = bad.arg_max()
        if row is not None and bad[row] and (first is None or row < first[0]):
            first = (row, int(name), text[row])
    if first is not None:
        row, column, cell = first
        name = f"'{layout.names[column]}'" if layout.names and layout.names[column] else f"{column + 1}"
        raise ReadError(
            f"{path}: line {lines[row]}, column {name}: {cell[:40]!r} is not a number; mend or delete that line."
        )


def sparse_words(cells: pl.Series, name: str, n_before: int) -> TextColumn | None:
    """A column of occasional remarks after ``n_before`` empty cells, if its name has no known meaning. None where the
    cells (n,) are all empty, or numbers are expected in them."""
    if not name or parse_name(name).role:
        return None
    words = cells.filter(_words(cells, False))
    if not len(words):
        return None
    return TextColumn(words[0], words={"": 0}, codes=[np.zeros(n_before, dtype=np.int64)])


def numbers(series: pl.Series, column: TextColumn | None) -> FloatArray:
    """A column as (n,) float64: numbers, or dates in seconds; empty where it contains words."""
    if column is None:
        return np.asarray(series.to_numpy(), dtype=np.float64)
    if column.form and column.form != "date":
        return seconds(series, column.form)
    column.encode(series)
    return np.empty(0)


def _words(series: pl.Series, decimal_comma: bool) -> pl.Series:
    """Mask of the cells that are neither a number nor a word for "missing"."""
    import polars as pl

    text = series.fill_null("").str.strip_chars()
    if decimal_comma:
        text = text.str.replace(",", ".", literal=True)
    return text.cast(pl.Float64, strict=False).is_null() & ~text.str.to_lowercase().is_in(list(MISSING))
