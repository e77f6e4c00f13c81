"""A report as plain JSON types and back, so that a saved result can be printed again as page or text."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.files.output import check_report
from trihedron.records import Finding, Severity
from trihedron.records.plain import is_array
from trihedron.report import chart, document
from trihedron.report.document import Document, Picture
from trihedron.report.machine import json_text
from trihedron.report.text import to_text

if TYPE_CHECKING:
    from cattrs import Converter

KEY = "report"
"""Key of the report in a saved result."""
VERSION = 1
DIGITS = 6
"""Significant digits of a drawn value: a 4k screen shows four."""


class NotAReportError(InputError):
    """A saved result without a report, or with one of another program."""


def with_report(machine: Mapping[str, Any], laid_out: Document) -> dict[str, Any]:
    """The JSON of a result with the report added, for ``trihedron report``."""
    return {**machine, KEY: {"version": VERSION, "document": _converter().unstructure(laid_out)}}


def written(laid_out: Document, machine: Callable[[], Mapping[str, Any]], path: Path) -> str:
    """A report as the content of a file, in the format of its ending; ``machine`` makes the JSON.

    Raises
    ------
    OutputError
        (a ``ValueError``) when the ending names no format.
    """
    check_report(path)
    ending = path.suffix.lower()
    if ending == ".html":
        # Imported here: its templates are slow to load.
        from trihedron.report.page import to_html

        return to_html(laid_out)
    if ending == ".txt":
        return to_text(document.with_its_making(laid_out))
    return json_text(with_report(machine(), laid_out))


def report_of(saved: Any) -> Document:
    """The report of a saved result.

    Raises
    ------
    NotAReportError
        (a ``ValueError``) when it has none, or a malformed one.
    """
    held = saved.get(KEY) if isinstance(saved, Mapping) else None
    if not isinstance(held, Mapping) or held.get("version") != VERSION:
        if isinstance(saved, Mapping) and "scenario" in saved:
            raise NotAReportError("it is the truth of a simulation; `trihedron simulate` writes its page by --report.")
        raise NotAReportError("it has no report: give a file written by --json FILE or --report FILE.json.")
    try:
        return _converter().structure(held.get("document"), Document)
    except (TypeError, ValueError, KeyError, RecursionError) as error:
        raise NotAReportError(f"the report saved in it is malformed: {error}") from None


@cache
def _converter() -> Converter:
    """Reader of the dataclasses of a report; values of a wrong type raise, since they are read from a file.

    The entry ``is`` names the class of a value of a union.
    """
    # Imported here: a command that writes no document does not need it.
    from cattrs import Converter
    from cattrs.strategies import configure_tagged_union

    made = Converter(unstruct_collection_overrides={tuple: list, Sequence: list}, detailed_validation=False)
    made.register_unstructure_hook(float, lambda value: float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None)
    made.register_structure_hook(float, lambda value, _: math.nan if value is None else float(_checked(value, float)))
    for kind in (str, bool, int):
        made.register_structure_hook(kind, lambda value, wanted: _checked(value, wanted))
    made.register_structure_hook_func(_is_literal, _literal)
    made.register_unstructure_hook_func(is_array, _line)
    made.register_structure_hook_func(is_array, lambda line, _: _array(_checked(line, str)))
    made.register_unstructure_hook(Finding, lambda found: {name: getattr(found, name) for name in _SAID})
    made.register_structure_hook(Finding, lambda value, _: _finding(value))

    def picture(value: dict[str, Any], _: Any) -> Picture:
        drawn = made.structure(value["chart"], chart.Chart)
        return Picture(_checked(value["name"], str), _checked(value["caption"], str), lambda: drawn)

    made.register_structure_hook(Picture, picture)
    made.register_unstructure_hook(
        Picture, lambda one: {"name": one.name, "caption": one.caption, "chart": made.unstructure(one.chart())}
    )
    for kinds in (chart.Mark, document.Block):
        configure_tagged_union(kinds, made, tag_name="is")
    return made


_SAID = ("code", "severity", "seen", "cause", "action")


def _finding(value: dict[str, Any]) -> Finding:
    code, severity, *said = (_checked(value[name], str) for name in _SAID)
    return Finding(code, Severity(severity), *said)


def _line(values: FloatArray) -> str:
    """Numbers in one line, rows separated by semicolons; one line per number would make files of megabytes."""
    rows = np.atleast_2d(np.asarray(values, dtype=np.float64))
    return ";".join(" ".join(f"{number:.{DIGITS}g}" for number in row) for row in rows)


def _array(line: str) -> FloatArray:
    rows = np.array([[float(word) for word in row.split()] for row in line.split(";")])
    return rows if len(rows) > 1 else rows[0]


def _is_literal(kind: Any) -> bool:
    return get_origin(kind) is Literal


def _literal(value: Any, wanted: Any) -> Any:
    if value not in get_args(wanted):
        raise TypeError(f"{str(value)[:40]!r} has no place here")
    return value


def _checked(value: Any, wanted: type) -> Any:
    if not isinstance(value, int | float if wanted is float else wanted):
        raise TypeError(f"{str(value)[:40]!r} has no place here")
    return value
