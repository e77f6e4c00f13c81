"""Rows of a table that are no samples: written twice, or read again before the sensor measured anew."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.probability import bdtrc
from trihedron.read.clock.base import Clock
from trihedron.read.clock.rate import steps_of
from trihedron.read.columns import Columns
from trihedron.read.table import Table
from trihedron.records import Finding

FEWEST_ROWS = 2
"""Smallest number of rows of a recording; rows are not removed as copies if fewer would remain."""
BY_CHANCE = 1e-3
"""Probability below which equal readings under equal timestamps are copies: one log of a thousand is wrong."""
WINDOW = 64
"""Rows over which axes repeat their readings independently; over longer ones they all do so in poses."""
RARE = 0.01
"""Share of samples that may equal the previous one by chance: excluded with those that were read again, they shift a
mean by a hundredth of an LSB at most."""
FIRST = 1 << 16
"""Samples at the start of a log in which it shows that a program reads faster than the sensor measures."""
PART = 1 << 20
"""Rows with timestamps of their own that show how often readings repeat by chance."""
LAGS = 8
"""Distances between rows whose equality is counted, beyond the longest run of repeated rows."""


def without_repeated_rows(table: Table, chosen: Columns, clock: Clock, findings: list[Finding]) -> Clock:
    """The clock without rows that are no samples: copies of the previous row, and readings read again before the
    sensor measured anew, at the time when they were read first."""
    readings = [values for column in chosen.readings if len(values := table.columns[column])]
    for is_copy in (True, False) if chosen.time is not None and readings else ():
        # A long log is indexed only where there is something to look for.
        if not (steps_of(clock.time_s).same if is_copy else _are_read_again(readings, clock.rows)):
            continue
        rows = np.arange(table.n_rows) if clock.rows is None else clock.rows
        every = np.arange(1, len(rows))
        again = _copied_rows(readings, clock.time_s, rows) if is_copy else every[_repeats(readings, rows, every).all(0)]
        if not len(again) or len(rows) - len(again) < FEWEST_ROWS:
            continue
        findings.append(
            Finding.of(
                "repeated-rows",
                "copies" if is_copy else "read-again",
                rows_left_out=len(again),
                share=len(again) / len(rows),
                where=table.place(int(rows[again[0]])),
                count=len(again),
                row=rows[again[0]],
            )
        )
        clock = Clock(np.delete(clock.time_s, again), clock.start_s, np.delete(rows, again), clock.findings)
    return clock


def _copied_rows(
    columns: Sequence[FloatArray], time_s: FloatArray, rows: npt.NDArray[np.signedinteger]
) -> npt.NDArray[np.signedinteger]:
    """Samples (k,) that repeat timestamp and readings of the previous sample, if more do so than by chance.

    ``columns`` are the readings (rows of the table), ``rows`` (n,) the table row of each sample. Samples timestamped on
    arrival share timestamps, and coarse codes or a sensor slower than the log repeat readings: how often, rows with
    timestamps of their own show, by all axes together and by each.
    """
    is_same = np.diff(time_s) == 0
    again, apart = np.flatnonzero(is_same) + 1, np.flatnonzero(~is_same)[:PART] + 1
    copies = again[_repeats(columns, rows, again).all(axis=0)]
    repeats = _repeats(columns, rows, apart)
    chance = max(_independent(repeats), float(repeats.all(axis=0).mean()))
    return copies if are_more(len(copies), len(again), chance) else again[:0]


def _are_read_again(columns: Sequence[FloatArray], rows: npt.NDArray[np.signedinteger] | None) -> bool:
    """Whether more of the first samples repeat all readings of the previous one than by chance, and chance is rare."""
    first = np.stack([values[:FIRST] if rows is None else values[rows[:FIRST]] for values in columns], axis=1)
    repeats = first[1:] == first[:-1]
    is_again = repeats.all(axis=1)
    if not are_more(int(is_again.sum()), len(repeats), _independent(repeats.T)):
        return False
    return equal_apart(first, int(np.diff(np.flatnonzero(np.r_[True, ~is_again, True])).max())) <= RARE


def equal_apart(readings: FloatArray, longest: int) -> float:
    """Share of rows (n, k) equal to one further back than the ``longest`` run of repeated rows reaches."""
    lags = [lag for lag in range(longest + 1, longest + 1 + LAGS) if lag < len(readings)]
    shares = [float(np.mean(np.all(readings[lag:] == readings[:-lag], axis=1))) for lag in lags]
    return sum(shares) / max(len(shares), 1)


def _independent(repeats: npt.NDArray[np.bool_]) -> float:
    """Share of samples in which axes that repeat independently, as often as each does, would repeat together."""
    width = max(min(WINDOW, repeats.shape[1]), 1)
    whole = repeats[:, : repeats.shape[1] // width * width].reshape(len(repeats), -1, width)
    return float(whole.mean(axis=2).prod(axis=0).mean()) if whole.size else 1.0


def are_more(count: int, n: int, chance: float, probability: float = BY_CHANCE) -> bool:
    """Whether ``count`` of ``n`` are more than by chance, and at twice its odds."""
    return count > 2.0 * chance / (1.0 + chance) * n and bool(bdtrc(count - 1, n, chance) < probability)


def _repeats(
    columns: Sequence[FloatArray], rows: npt.NDArray[np.signedinteger], at: npt.NDArray[np.signedinteger]
) -> npt.NDArray[np.bool_]:
    """(1 + axes, k) whether readings of the samples ``at`` (k,) equal those of the previous sample; row 0 is true."""
    equal = [values[rows[at]] == values[rows[at - 1]] for values in columns]
    return np.array([np.ones(len(at), dtype=bool), *equal])
