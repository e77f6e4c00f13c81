"""Rows in the order they were taken: counters that wrap, packets that overtook each other."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.read.errors import ReadError
from trihedron.read.table import Table
from trihedron.records import Finding, FindingCode

MAX_DISPLACEMENT = 64
"""Rows a packet may arrive late. Anything further is another recording, not another order."""
_MODULI = (2.0**16, 2.0**24, 2.0**32)


def _place(table: Table, rows: npt.NDArray[np.int64] | None, sample: int) -> str:
    return table.place(int(rows[sample]) if rows is not None else sample)


def unwrap(
    raw: FloatArray, table: Table, rows: npt.NDArray[np.int64] | None, findings: list[Finding]
) -> tuple[FloatArray, bool]:
    """A tick counter of 16, 24 or 32 bits that started again from zero, continued."""
    if len(raw) < 3:
        return raw, False
    step = np.diff(raw)
    back = np.flatnonzero(step < 0)
    if not len(back) or raw.min() < 0:
        return raw, False
    usual = float(np.median(step[step > 0])) if np.any(step > 0) else 0.0
    for modulus in _MODULI:
        continued = step[back] + modulus
        if raw.max() < modulus and usual > 0 and np.all((continued >= 0) & (continued <= 100 * usual)):
            turns = np.zeros(len(raw))
            turns[back + 1] = modulus
            findings.append(
                Finding.of(
                    FindingCode.TIME_WRAPPED,
                    bits=int(np.log2(modulus)),
                    count=len(back),
                    where=_place(table, rows, int(back[0]) + 1),
                    sample=back[0] + 1,
                )
            )
            return raw + np.cumsum(turns), True
    return raw, False


def order_of_rows(
    raw: FloatArray, table: Table, column: int, rows: npt.NDArray[np.int64] | None, findings: list[Finding]
) -> npt.NDArray[np.int64] | None:
    """Rows in order of their stamps; ``None`` where they are.

    Raises
    ------
    ReadError
        When time runs backward as a whole or jumps back further than a packet may be late.
    """
    step = np.diff(raw)
    back = np.flatnonzero(step < 0)
    if not len(back):
        return None
    first = int(back[0]) + 1
    place = _place(table, rows, first)
    if len(back) > 0.5 * len(step):
        raise ReadError(
            f"{table.path}: time runs backward ({len(back)} of {len(step)} steps, first at {place}); "
            "the rows stand in reverse order or column "
            f"{table.label(column)} is not a time: turn the rows round or name another time column."
        )
    order = np.argsort(raw, kind="stable").astype(np.int64)
    displaced = int(np.max(np.abs(order - np.arange(len(order)))))
    if displaced > MAX_DISPLACEMENT:
        raise ReadError(
            f"{table.path}: the clock jumps back by {-float(step[back].min()):.6g} (in its own unit) at "
            f"{_place(table, rows, int(back[np.argmin(step[back])]) + 1)}: two recordings in one file, or a clock that "
            "was set; cut the file there."
        )
    findings.append(
        Finding.of(FindingCode.TIME_BACKWARD, count=len(back), where=place, displaced_rows=displaced, sample=first)
    )
    return order
