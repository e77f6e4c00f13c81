"""A report as plain JSON types and back: what a saved result is laid out again from, page or text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from trihedron.errors import RefusedError
from trihedron.records import Finding, FindingCode, Severity
from trihedron.report import chart, document
from trihedron.report.document import Document, Picture

KEY = "report"
"""Where a saved result holds its report."""
VERSION = 1
DIGITS = 6
"""Significant digits of a drawn value: a page of 4 k shows four."""
_KINDS: dict[str, type] = {
    kind.__name__: kind
    for kind in (
        document.Document, document.Section, document.Headline, document.Paragraph, document.Facts, document.Table,
        document.Code, document.FindingList, document.Picture, chart.Chart, chart.Panel, chart.Disc, chart.Sphere,
        chart.Matrix, chart.Scale, chart.Line, chart.Points, chart.Bars, chart.Band, chart.Span, chart.Level,
        chart.Note,
    )
}  # fmt: skip


class NotAReportError(RefusedError):
    """A saved result that holds no report, or one that is not of this program."""


def with_report(machine: Mapping[str, Any], laid_out: Document) -> dict[str, Any]:
    """The result for machines with the report beside it, from which ``trihedron report`` lays it out again."""
    return {**machine, KEY: {"version": VERSION, "document": _plain(laid_out)}}


def report_of(saved: Any) -> Document:
    """The report that a saved result holds.

    Raises
    ------
    NotAReportError
        (a ``ValueError``) when it holds none, or one that is malformed.
    """
    held = saved.get(KEY) if isinstance(saved, Mapping) else None
    if not isinstance(held, Mapping) or held.get("version") != VERSION:
        raise NotAReportError("no report is saved in it: write it again with --json FILE or --report FILE.json.")
    try:
        found = _made(held.get("document"), Document)
    except (TypeError, ValueError, KeyError, RecursionError) as error:
        raise NotAReportError(f"the report saved in it is malformed: {error}") from None
    assert isinstance(found, Document)
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, Picture):
        return {"is": "Picture", "name": value.name, "caption": value.caption, "chart": _plain(value.chart())}
    if isinstance(value, Finding):
        return {name: _plain(getattr(value, name)) for name in ("code", "severity", "seen", "cause", "action")}
    if is_dataclass(value) and not isinstance(value, type):
        return {"is": type(value).__name__, **{f.name: _plain(getattr(value, f.name)) for f in fields(value)}}
    if isinstance(value, np.ndarray):
        rows = np.atleast_2d(np.asarray(value, dtype=np.float64))
        return ";".join(" ".join(f"{number:.{DIGITS}g}" for number in row) for row in rows)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, float | np.floating):
        return float(f"{float(value):.{DIGITS}g}") if math.isfinite(value) else None
    if isinstance(value, str | bool | int) or value is None:
        return value
    return [_plain(one) for one in value]


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def _made(value: Any, wanted: Any) -> Any:
    """A value of the type wanted; what is of another one is refused, since it comes from a file."""
    origin, inner = get_origin(wanted), get_args(wanted)
    if origin is np.ndarray:
        # One line of numbers, rows apart by semicolons: a signal on a line of its own a number would be a megabyte.
        rows = np.array(
            [[float(word) for word in row.split()] for row in _checked(value, isinstance(value, str)).split(";")]
        )
        return rows if len(rows) > 1 else rows[0]
    if origin in (Union, UnionType):
        return _one_of(value, inner)
    if origin is Literal:
        return _checked(value, value in inner)
    if origin is tuple:
        return _tuple(value, inner)
    if origin is Sequence:
        return tuple(_made(one, inner[0]) for one in _list(value))
    if wanted is Finding:
        code, severity = FindingCode(value["code"]), Severity(value["severity"])
        return Finding(code, severity, *(_made(value[name], str) for name in ("seen", "cause", "action")))
    if is_dataclass(wanted):
        return _record(value, wanted)
    if wanted is float:
        return math.nan if value is None else float(_checked(value, isinstance(value, int | float)))
    return _checked(value, isinstance(value, wanted))


def _record(value: Any, wanted: Any) -> Any:
    named = value.get("is") if isinstance(value, dict) else None
    kind = _KINDS.get(named) if isinstance(named, str) else None
    if kind is not wanted or kind is None:
        raise TypeError(f"a {getattr(wanted, '__name__', wanted)} was expected")
    if kind is Picture:
        drawn = _made(value["chart"], chart.Chart)
        return Picture(_made(value["name"], str), _made(value["caption"], str), lambda: drawn)
    hints = _hints(kind)
    return kind(**{f.name: _made(value[f.name], hints[f.name]) for f in fields(kind)})


def _one_of(value: Any, kinds: tuple[Any, ...]) -> Any:
    if value is None and type(None) in kinds:
        return None
    named = value.get("is") if isinstance(value, dict) else None
    for kind in kinds:
        if kind is not type(None) and (named is None or getattr(kind, "__name__", "") == named):
            return _made(value, kind)
    raise TypeError(f"{str(named)[:40]} has no place here")


def _tuple(value: Any, inner: tuple[Any, ...]) -> Any:
    if len(inner) == 2 and inner[1] is Ellipsis:
        return tuple(_made(one, inner[0]) for one in _list(value))
    return tuple(_made(one, kind) for one, kind in zip(_list(value), inner, strict=True))


def _list(value: Any) -> list[Any]:
    out: list[Any] = _checked(value, isinstance(value, list))
    return out


def _checked(value: Any, is_right: bool) -> Any:
    if not is_right:
        raise TypeError(f"{str(value)[:40]!r} has no place here")
    return value
