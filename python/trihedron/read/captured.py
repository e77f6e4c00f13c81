"""Logs of ``trihedron capture``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrivals import paced
from trihedron.read.table import Table


def with_arrivals(table: Table, time: int) -> Table:
    """A log of ``trihedron capture`` from a board without a clock, its times paced anew by all of its arrivals.

    While it is recorded the first seconds can only guess the rate; the log keeps counter and arrivals for this.
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
