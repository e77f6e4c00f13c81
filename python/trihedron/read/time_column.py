"""The time of a log: summed time steps, times from arrivals, and rejection of a time column that is not understood."""

import re
from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.arrivals import paced
from trihedron.read.clock.unit import SECONDS, seconds_of
from trihedron.read.columns import Columns
from trihedron.read.errors import ReadError
from trihedron.read.names import parse_name
from trihedron.read.table import Table
from trihedron.records import Finding


def summed_steps(table: Table, chosen: Columns) -> tuple[Table, Columns]:
    """The table with its column of time steps replaced by their sum, which is the time; unchanged without one."""
    for i, name in enumerate(table.names or ()):
        step, parsed = table.columns[i], parse_name(name)
        if parsed.role != "step" or not len(step) or not (np.all(step >= 0.0) and np.median(step) > 0.0):
            continue
        columns = tuple(np.cumsum(step) if k == i else column for k, column in enumerate(table.columns))
        note = Finding.of("time-unit-detected", "sum-of-steps", column=table.label(i))
        table = replace(table, columns=columns, findings=(*table.findings, note))
        return table, replace(chosen, time=i, time_unit=parsed.time_unit)
    return table, chosen


ALIKE = 0.05
"""Largest relative difference of the spans of clocks that measure the same time."""


def agreed_unit(table: Table, time: int, named: str) -> tuple[str, tuple[Finding, ...]]:
    """The unit that a time column is ``named`` in, or, stated by a finding, the one in which it lasts as long as two or
    more other clocks of the log do by their names."""
    parsed = [parse_name(name) for name in table.names or ()]
    spans = [
        seconds_of(one.time_unit) * float(column[-1] - column[0])
        for i, (one, column) in enumerate(zip(parsed, table.columns, strict=False))
        if i != time and one.role == "time" and len(column) and column[-1] > column[0]
    ]
    own = float(table.columns[time][-1] - table.columns[time][0])
    if len(spans) < 2 or not (own > 0.0 and max(spans) < (1.0 + ALIKE) * min(spans)):
        return named, ()
    unit = next((one for one, size in SECONDS.items() if abs(size * own / spans[0] - 1.0) < ALIKE), named)
    if unit == named or not own * seconds_of(named) > 0.0:
        return named, ()
    column, count = table.label(time), len(spans)
    return unit, (Finding.of("time-unit-detected", "other-clocks", column=column, named=named, count=count, unit=unit),)


def with_arrivals(table: Table, time: int) -> Table:
    """A log of ``trihedron capture`` from a board without a clock, with its times recomputed from all arrivals.

    During the capture the rate is uncertain in the first seconds; the log contains counter and arrivals for this.
    """
    names = table.names or ()
    if table.metadata.get("device clock") != "none" or not {"frame", "host_s"} <= set(names):
        return table
    frame, host_s = (table.columns[names.index(name)] for name in ("frame", "host_s"))
    if not len(frame) or np.isnan(frame).any() or np.isnan(host_s).any():
        return table
    columns = list(table.columns)
    columns[time] = paced(frame, host_s)
    return replace(table, columns=tuple(columns))


_CLOCK = re.compile(r"\d[:.h]\d\d[:.m]\d\d")
"""Hours, minutes and seconds with any usual separators."""
FEWEST_ROWS = 20
"""Number of rows below which readings may increase in every row by chance."""
NEARLY_ALL = 0.99
"""Smallest share of increasing steps of a clock; a few timestamps may be equal."""


def reject_unread_time(table: Table, chosen: Columns, mapping: str | None, rate_hz: float | None) -> None:
    """Reject a table with a column that looks like a time but is not understood, unless ``mapping`` names the time.

    ``rate_hz`` is the rate that is known without a clock, if any.

    Raises ``ReadError`` when there is such a column; the message names it and the options to give.
    """
    if table.names is None or (mapping is not None and re.search(r"(?:t|time)\s*=", mapping)):
        return
    has_time = any(parse_name(name).role == "time" for i, name in enumerate(table.names) if i not in table.words)
    for i, example in table.words.items():
        is_clock = not has_time and _CLOCK.search(example) is not None
        if is_clock or parse_name(table.names[i]).role == "time":
            raise ReadError(
                f"{table.path}: column {table.label(i)} contains {example[:40]!r}, which is no time known here; write "
                "it in seconds or as 2024-03-01 12:00:00.000, or read with --columns time=none --rate HZ."
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
    """Whether numbers (n,) increase in nearly every row, but not by 1, as a counter does."""
    if len(values) < FEWEST_ROWS:
        return False
    step = np.diff(values)
    return bool(np.mean(step > 0.0) >= NEARLY_ALL and np.median(step) != 1.0)
