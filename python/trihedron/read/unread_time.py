"""A time that is in the log but not understood must not become 100 Hz."""

from __future__ import annotations

import re

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.read.columns import Columns
from trihedron.read.errors import ReadError
from trihedron.read.names import parse_name
from trihedron.read.table import Table

_CLOCK = re.compile(r"\d[:.h]\d\d[:.m]\d\d")
"""Hours, minutes and seconds in some order of marks."""
FEWEST_ROWS = 20
"""Rows below which readings may well grow from row to row."""
NEARLY_ALL = 0.99
"""Steps of a clock that go forward; a timestamp written twice now and then is still a clock's."""


def refuse_unread_time(table: Table, chosen: Columns, mapping: str | None, rate_hz: float | None) -> None:
    """Nothing, where no column without a known name can be a time, or the user's ``mapping`` says what is.

    ``rate_hz`` is the rate that is known without a clock, if any.

    Raises
    ------
    ReadError
        Naming the column and what to say of it.
    """
    if table.names is None or (mapping is not None and re.search(r"(?:t|time)\s*=", mapping)):
        return
    has_time = any(parse_name(name).role == "time" for i, name in enumerate(table.names) if i not in table.words)
    for i, example in table.words.items():
        is_clock = not has_time and _CLOCK.search(example) is not None
        if is_clock or parse_name(table.names[i]).role == "time":
            raise ReadError(
                f"{table.path}: column {table.label(i)} holds {example[:40]!r}, which is no time known here; write it "
                "in seconds or as 2024-03-01 12:00:00.000, or read with --columns time=none --rate HZ."
            )
    if rate_hz is not None or mapping is not None:
        return
    for i, name in enumerate(table.names):
        if i not in chosen.used() and not parse_name(name).role and _runs_like_a_clock(table.columns[i]):
            raise ReadError(
                f"{table.path}: column {table.label(i)} grows from row to row as a time does, but its name "
                f"says nothing known here; read with --columns time={i + 1}, or with --columns time=none --rate HZ."
            )


def _runs_like_a_clock(values: FloatArray) -> bool:
    """Whether numbers (n,) grow at nearly every row, but not by one each, which a counter does too."""
    if len(values) < FEWEST_ROWS:
        return False
    step = np.diff(values)
    return bool(np.mean(step > 0.0) >= NEARLY_ALL and np.median(step) != 1.0)
