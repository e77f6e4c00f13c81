"""A log that holds the time since the row before, and no time: its sum is the time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.read.columns import Columns
from trihedron.read.names import parse_name
from trihedron.read.table import Table
from trihedron.records import Finding, FindingCode


def summed_steps(table: Table, chosen: Columns) -> tuple[Table, Columns]:
    """The table with the sum of its column of steps in place of them, as its time; both as they are without one."""
    for i, name in enumerate(table.names or ()):
        step, parsed = table.columns[i], parse_name(name)
        if parsed.role != "step" or not len(step) or not (np.all(step >= 0.0) and np.median(step) > 0.0):
            continue
        columns = tuple(np.cumsum(step) if k == i else column for k, column in enumerate(table.columns))
        note = Finding.of(FindingCode.TIME_UNIT_DETECTED, "sum-of-steps", column=table.label(i))
        table = replace(table, columns=columns, findings=(*table.findings, note))
        return table, replace(chosen, time=i, time_unit=parsed.time_unit)
    return table, chosen
