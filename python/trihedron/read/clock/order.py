"""Rows in the order of sampling: counters that wrap, packets that arrived out of order."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.read.errors import ReadError
from trihedron.read.table import Table
from trihedron.records import Finding, FindingCode
from trihedron.records.words import Words

MAX_DISPLACEMENT = 64
"""Largest number of rows by which a packet may be late; a larger one means another recording."""
PART = 1 << 20
"""Rows of a long log that are processed together."""
_MODULI = (2.0**16, 2.0**24, 2.0**32)


def _place(table: Table, rows: npt.NDArray[np.signedinteger] | None, sample: int) -> Words:
    return table.place(int(rows[sample]) if rows is not None else sample)


def unwrap(
    raw: FloatArray, table: Table, rows: npt.NDArray[np.signedinteger] | None, findings: list[Finding]
) -> tuple[FloatArray, bool]:
    """Timestamps from a tick counter of 16, 24 or 32 bits, continued where it wraps, and whether it wraps."""
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


def in_order(values: FloatArray, rows: npt.NDArray[np.signedinteger], out: FloatArray) -> FloatArray:
    """Write ``values[rows]`` into ``out`` in parts, because indexing converts 32-bit row numbers to 64 bits."""
    for start in range(0, len(rows), PART):
        out[start : start + PART] = values[rows[start : start + PART]]
    return out


def _overlapping(raw: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """Yield parts of the timestamps, each with the first one of the next part, and the index at which each starts."""
    for start in range(0, max(len(raw) - 1, 1), PART):
        yield start, raw[start : start + PART + 1]


def order_of_rows(
    raw: FloatArray, table: Table, column: int, rows: npt.NDArray[np.signedinteger] | None, findings: list[Finding]
) -> npt.NDArray[np.signedinteger] | None:
    """Row numbers in order of the timestamps; ``None`` where rows are in order already.

    Raises ``ReadError`` when time runs backward as a whole or jumps back further than a packet may be late.
    """
    back = np.concatenate([start + np.flatnonzero(np.diff(part) < 0) for start, part in _overlapping(raw)])
    if not len(back):
        return None
    first = int(back[0]) + 1
    place = _place(table, rows, first)
    if len(back) > 0.5 * (len(raw) - 1):
        raise ReadError(
            f"{table.path}: time runs backward ({len(back)} of {len(raw) - 1} steps, first at {place}); "
            "the rows stand in reverse order or column "
            f"{table.label(column)} is not a time: turn the rows round or name another time column."
        )
    order = np.argsort(raw, kind="stable")
    if len(raw) < np.iinfo(np.int32).max:
        # Half the memory, for long logs.
        order = order.astype(np.int32)
    displaced = max(
        int(np.max(np.abs(order[a : a + PART] - np.arange(a, min(a + PART, len(order))))))
        for a in range(0, len(order), PART)
    )
    if displaced > MAX_DISPLACEMENT:
        step = raw[back + 1] - raw[back]
        raise ReadError(
            f"{table.path}: the clock jumps back by {-float(step.min()):.6g} (in its own unit) at "
            f"{_place(table, rows, int(back[np.argmin(step)]) + 1)}: two recordings in one file, or a clock that "
            "was set; cut the file there."
        )
    findings.append(
        Finding.of(FindingCode.TIME_BACKWARD, count=len(back), where=place, displaced_rows=displaced, sample=first)
    )
    return order
