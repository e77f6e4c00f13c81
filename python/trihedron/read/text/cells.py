"""Cells of a block of text as numbers, dates or words, parsed by polars."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.read.errors import errors_of_polars
from trihedron.read.names import parse_name
from trihedron.read.text.layout import MISSING, Layout

if TYPE_CHECKING:
    import polars as pl

# polars is imported where it is used: the import takes longer than reading a short log, and most logs do not need it.

MAX_WORDS = 64
"""Largest number of distinct words of a column that may identify sensors or devices; with more it is text."""
JUDGED = 200
"""Cells from which it is determined whether a column contains dates or words."""


@dataclass
class TextColumn:
    """A column without numbers: ``form`` of its dates or "", an example, and its cells so far (not those of dates)."""

    example: str
    form: str = ""
    cells: list[pl.Series] = field(default_factory=list)

    @property
    def is_time(self) -> bool:
        """Whether the cells are times."""
        return self.form not in ("", "date")

    def add(self, cells: pl.Series) -> FloatArray | float:
        """Cells of dates as (n,) seconds; NaN for words, whose cells are kept."""
        if self.is_time:
            return seconds(cells, self.form)
        self.cells.append(cells)
        return np.nan

    def past_midnight(self, time_s: FloatArray) -> FloatArray:
        """Times of day [s] continued after midnight (a step back by more than half a day is a new day), or dates."""
        if self.form != "time-of-day":
            return time_s
        step = np.diff(time_s, prepend=time_s[:1])
        with np.errstate(invalid="ignore"):
            return np.asarray(time_s + _DAY_S * np.cumsum(step < -0.5 * _DAY_S), dtype=np.float64)

    def labels(self) -> tuple[tuple[str, ...], IntArray] | None:
        """As :func:`labels_of`, of all cells."""
        import polars as pl

        return labels_of(pl.concat(self.cells))


def labels_of(cells: Sequence[str | None] | pl.Series) -> tuple[tuple[str, ...], IntArray] | None:
    """Distinct words of cells in order, and the index (n,) of each one's word; None where too many are distinct."""
    import polars as pl

    text = pl.Series(cells, dtype=pl.String).fill_null("").str.strip_chars(' "')
    words = text.unique(maintain_order=True).to_list()
    if len(words) > MAX_WORDS:
        return None
    codes = text.replace_strict(words, list(range(len(words))), return_dtype=pl.Int64)
    return tuple(words), np.asarray(codes.to_numpy(), dtype=np.int64)


def parse(path: Path, data: bytes, layout: Layout, first_line: int) -> list[pl.Series]:
    """The cells of a block as text, column by column.

    Raises ``ReadError`` when the block is not a table.
    """
    import polars as pl

    with errors_of_polars(path, f"the text from line {first_line} on cannot be read as a table"):
        return pl.read_csv(
            io.BytesIO(data),
            has_header=False,
            separator=layout.separator,
            schema={str(i): pl.String for i in range(layout.n_fields)},
            truncate_ragged_lines=True,
            quote_char='"' if b'"' in data else None,
            encoding="utf8-lossy",
        ).get_columns()


def numbers(cells: pl.Series, decimal_comma: bool) -> tuple[FloatArray, pl.Series]:
    """(n,) numbers of cells, NaN where there is none; mask of the cells that are neither that nor a word for
    "missing"."""
    import polars as pl

    text = cells.fill_null("").str.strip_chars()
    if decimal_comma:
        text = text.str.replace(",", ".", literal=True)
    values = text.cast(pl.Float64, strict=False)
    bad = values.is_null()
    if values.null_count():
        bad &= ~text.str.to_lowercase().is_in(list(MISSING))
    return np.asarray(values.to_numpy(), dtype=np.float64), bad


def text_column(cells: pl.Series, values: FloatArray, words: pl.Series, name: str, n_before: int) -> TextColumn | None:
    """The column of dates or words that cells are, ``words`` being the mask of those that are no numbers.

    In the first block most of the first cells are words. After ``n_before`` empty cells, and where none of ``values``
    so far is a number, words are occasional remarks, unless numbers are expected by the name. None for a column of
    numbers.
    """
    import polars as pl

    is_first = words.head(JUDGED)
    if n_before == 0 and is_first.sum() > 0.5 * len(is_first):
        first = cells.head(JUDGED).filter(is_first)
        return TextColumn(first[0], form_of(first) or "")
    if not name or parse_name(name).role or not np.isnan(values).all():
        return None
    return TextColumn(cells.filter(words)[0], cells=[pl.repeat("", n_before, dtype=pl.String, eager=True)])


# Dates and times of day in usual formats as seconds.

_DAY_S = 86400.0
_ZONE = r"(?:Z|[+-]\d\d:?\d\d)?"
_CLOCK = r"\d{1,2}:\d\d:\d\d(?:[.,:]\d{1,9})?"


_MONTH_FIRST, _DAY_FIRST = "%m-%d-%Y %H:%M:%S%.f", "%d-%m-%Y %H:%M:%S%.f"
_NUMBERS_ALONE = rf"^\d\d?-\d\d?-\d{{4}} {_CLOCK}$"
# Polars' %.f takes a point and any number of digits, or nothing.
_FORMS = {
    rf"^\d{{4}}-\d\d-\d\d {_CLOCK}{_ZONE}$": "%Y-%m-%d %H:%M:%S%.f",
    rf"^\d\d?-[A-Za-z]{{3}}-\d{{4}} {_CLOCK}$": "%d-%b-%Y %H:%M:%S%.f",
    rf"^\d\d?-\d\d?-\d{{4}} {_CLOCK} ?[AaPp][Mm]$": "%m-%d-%Y %I:%M:%S%.f %p",
    _NUMBERS_ALONE: _MONTH_FIRST,
}
"""Patterns of whole cells, and their strptime formats, both after :func:`_plain`."""
_TIME_OF_DAY = re.compile(rf"^{_CLOCK}$")
_POINTS = re.compile(r"^[ \"]*\d\d?\.\d\d?\.\d{4}[ T]")
_DATE_ALONE = re.compile(r"^(\d{4}[-/.]\d\d?[-/.]\d\d?|\d\d?[-/.]\d\d?[-/.]\d{4})$")


def _plain(cells: pl.Series) -> pl.Series:
    """Cells with ``-`` in dates, one blank before the time, ``:`` inside it and a point before its fraction."""
    text = cells.str.strip_chars(' "').str.replace_all("/", "-", literal=True)
    text = text.str.replace(r"^(\d{4}-\d\d-\d\d)[T_]", "${1} ")
    # Day, month and year separated by points, as in Central Europe: the day is first.
    text = text.str.replace(r"^(\d\d?)\.(\d\d?)\.(\d{4})[ T]", "${1}-${2}-${3} ")
    # MetaBase writes 12.34.56.789, AndroSensor 12:34:56:789.
    text = text.str.replace(r"(\d\d?)\.(\d\d)\.(\d\d)([.,]\d+)", "${1}:${2}:${3}${4}")
    return text.str.replace(r"(:\d\d:\d\d)[,:](\d+)", "${1}.${2}")


def form_of(cells: pl.Series) -> str | None:
    """The format of all cells (a sample): a strptime format, ``time-of-day`` or ``date``; None where there is none."""
    text = _plain(cells.drop_nulls())
    if not len(text):
        return None
    if all(_POINTS.match(cell) for cell in cells.drop_nulls()):
        return _DAY_FIRST if text.str.contains(_NUMBERS_ALONE).all() else None
    for pattern, form in _FORMS.items():
        if text.str.contains(pattern).all():
            is_day_first = form == _MONTH_FIRST and bool(np.isnan(seconds(cells, form)).any())
            return _DAY_FIRST if is_day_first else form
    if all(_TIME_OF_DAY.match(cell) for cell in text):
        return "time-of-day"
    if all(_DATE_ALONE.match(cell.strip(' "')) for cell in cells.drop_nulls()):
        return "date"
    return None


def seconds(cells: pl.Series, form: str) -> FloatArray:
    """Seconds of cells (n,), since 1970 or since midnight; NaN where a cell has another form.

    Time zones are not applied: only differences matter, and a log has one zone.
    """
    import polars as pl

    text = _plain(cells)
    if form == "time-of-day":
        parts = text.str.extract_groups(r"^(\d{1,2}):(\d\d):(\d\d(?:\.\d+)?)$").struct.unnest()
        hours, minutes, secs = (parts.to_series(i).cast(pl.Float64, strict=False).to_numpy() for i in range(3))
        return np.asarray(3600.0 * hours + 60.0 * minutes + secs, dtype=np.float64)
    if form.startswith("%Y"):
        text = text.str.replace(r"(Z|[+-]\d\d:?\d\d)$", "")
    timestamps = text.str.to_datetime(form, time_unit="ns", strict=False)
    return np.asarray(timestamps.dt.timestamp("ns").cast(pl.Float64).to_numpy() / 1e9, dtype=np.float64)
