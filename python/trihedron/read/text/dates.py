"""Conversion of dates and times of day in usual formats to seconds."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from trihedron.arrays import FloatArray

if TYPE_CHECKING:
    import polars as pl

_DAY_S = 86400.0
_ZONE = r"(?:Z|[+-]\d\d:?\d\d)?"
_CLOCK = r"\d{1,2}:\d\d:\d\d(?:[.,:]\d{1,9})?"


@dataclass(frozen=True)
class _Form:
    """``pattern`` of the whole cell, and its strptime format, both after :func:`_plain`."""

    pattern: str
    format: str


_MONTH_FIRST, _DAY_FIRST = "%m-%d-%Y %H:%M:%S%.f", "%d-%m-%Y %H:%M:%S%.f"
# Polars' %.f takes a point and any number of digits, or nothing.
_FORMS = (
    _Form(rf"^\d{{4}}-\d\d-\d\d {_CLOCK}{_ZONE}$", "%Y-%m-%d %H:%M:%S%.f"),
    _Form(rf"^\d\d?-[A-Za-z]{{3}}-\d{{4}} {_CLOCK}$", "%d-%b-%Y %H:%M:%S%.f"),
    _Form(rf"^\d\d?-\d\d?-\d{{4}} {_CLOCK} ?[AaPp][Mm]$", "%m-%d-%Y %I:%M:%S%.f %p"),
    _Form(rf"^\d\d?-\d\d?-\d{{4}} {_CLOCK}$", _MONTH_FIRST),
)
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
        return _DAY_FIRST if text.str.contains(_FORMS[-1].pattern).all() else None
    for form in _FORMS:
        if text.str.contains(form.pattern).all():
            is_day_first = form.format == _MONTH_FIRST and bool(np.isnan(seconds(cells, form.format)).any())
            return _DAY_FIRST if is_day_first else form.format
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


def past_midnight(time_of_day_s: FloatArray) -> FloatArray:
    """Times of day [s] continued after midnight: a step back by more than half a day is a new day."""
    step = np.diff(time_of_day_s, prepend=time_of_day_s[:1])
    with np.errstate(invalid="ignore"):
        return np.asarray(time_of_day_s + _DAY_S * np.cumsum(step < -0.5 * _DAY_S), dtype=np.float64)
