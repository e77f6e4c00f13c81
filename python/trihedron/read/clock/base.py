"""Seconds from a time column: unit, start, wraps, order."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray, IntArray
from trihedron.probability import LN_FAULT
from trihedron.read.clock.rate import RESET, modulus_of, steps_of, usual_step
from trihedron.read.clock.unit import Witness, seconds_of, time_unit
from trihedron.read.errors import ReadError
from trihedron.read.table import Table
from trihedron.records import Finding
from trihedron.records.words import Words

_SHORTEST_STEP_S = 1e-9
"""Smallest mean step of a log [s]; no ADC samples faster."""
_LONGEST_S = 3.2e9
"""Longest duration of a log [s]: a century."""
NOBODY = Witness()


@dataclass(frozen=True, eq=False)
class Clock:
    """``time_s`` (n,) [s] from the first sample on, ``start_s`` the clock's time there, ``rows`` (n,) of the table."""

    time_s: FloatArray
    start_s: float
    rows: npt.NDArray[np.signedinteger] | None
    findings: tuple[Finding, ...]


def build_clock(
    table: Table,
    column: int,
    named: str,
    given: str | None,
    nanoseconds: int | None = None,
    witness: Witness = NOBODY,
    in_place: bool = False,
) -> Clock:
    """Seconds from a time column, or from whole seconds and a column of ``nanoseconds`` beside them.

    ``witness`` contains readings that limit the time between rows, for use where the unit is not stated. With
    ``in_place`` the clock may overwrite the column, which must not be used afterwards.

    Raises ``ReadError`` when the column is constant, runs backward as a whole, or jumps back further than rows can be
    late.
    """
    raw = table.columns[column]
    base = 0.0
    if nanoseconds is not None:
        # Relative to the first second, so that nanoseconds keep all digits.
        base = float(raw[0]) if np.isfinite(raw[0]) else 0.0
        raw = (raw - base) + 1e-9 * table.columns[nanoseconds]
        named = "s"
    findings: list[Finding] = []
    rows: npt.NDArray[np.signedinteger] | None = None
    steps = steps_of(raw)
    if steps.missing:
        finite = np.isfinite(raw)
        bad = int(np.flatnonzero(~finite)[0])
        if finite.sum() < 2:
            raise ReadError(
                f"{table.path}: the time column {table.label(column)} contains no numbers; name another one."
            )
        count = np.count_nonzero(~finite)
        findings.append(
            Finding.of(
                "non-finite",
                "time",
                count=count,
                where=table.place(bad),
                row=bad,
                numbers={"rows_left_out": float(count)},
            )
        )
        rows = np.flatnonzero(finite)
        raw = raw[rows]
        steps = steps_of(raw)
    if len(raw) > 1 and steps.same == len(raw) - 1:
        raise ReadError(
            f"{table.path}: the time column {table.label(column)} contains {raw[0]:.12g} in every row; "
            "choose another with --columns time=..., or --columns time=none with --rate."
        )
    raw, wraps = unwrap(raw, table, rows, findings) if steps.back else (raw, False)
    raw, order = forward(raw, table, column, rows, findings) if steps.back else (raw, None)
    if order is not None:
        rows = order if rows is None else rows[order]
    unit = time_unit(raw, named, given, wraps, witness, findings)
    scale = seconds_of(unit)
    span, n_steps = (raw[-1] - raw[0]) * scale, max(len(raw) - 1, 1)
    if not _SHORTEST_STEP_S * n_steps <= span < _LONGEST_S:
        is_short = span < _SHORTEST_STEP_S * n_steps
        how = f"steps by {span / n_steps:.3g} s" if is_short else f"spans {span:.3g} s"
        raise ReadError(
            f"{table.path}: column {table.label(column)} read as time in {unit} {how}, which no log does; give "
            "--time-unit, or name another time column."
        )
    first = float(raw[0])
    # In place where the array is a copy, to save memory for a long log.
    is_own = order is not None or rows is not None or nanoseconds is not None or in_place
    time_s = np.subtract(raw, first, out=raw if is_own else None)
    if scale != 1.0:
        time_s *= scale
    return Clock(time_s, float(base + first) * scale, rows, tuple(findings))


# Rows in the order of sampling: counters that wrap, packets that arrived out of order.

MAX_DISPLACEMENT = 64
"""Largest number of rows by which a packet may be late; a larger one means another recording."""


def _place(table: Table, rows: npt.NDArray[np.signedinteger] | None, sample: int) -> Words:
    return table.place(int(rows[sample]) if rows is not None else sample)


def unwrap(
    raw: FloatArray, table: Table, rows: npt.NDArray[np.signedinteger] | None, findings: list[Finding]
) -> tuple[FloatArray, bool]:
    """Timestamps from a counter, continued where it wraps, and whether it wraps."""
    step = np.diff(raw)
    back = np.flatnonzero(step < 0)
    modulus = modulus_of(raw) if len(back) else 0.0
    # A late row steps back by less than half of the range, a wrap by more.
    if not modulus or np.any(step[back] + modulus > min(RESET * usual_step(raw), 0.5 * modulus)):
        return raw, False
    turns = np.zeros(len(raw))
    turns[back + 1] = modulus
    findings.append(
        Finding.of(
            "time-wrapped",
            modulus=modulus,
            count=len(back),
            where=_place(table, rows, int(back[0]) + 1),
            sample=back[0] + 1,
        )
    )
    return raw + np.cumsum(turns), True


def _n_uneven(step: FloatArray, usual: float) -> int:
    """Number of steps that are not the usual one, to half of it."""
    return int(np.count_nonzero(np.abs(step - usual) > 0.5 * usual))


def forward(
    raw: FloatArray, table: Table, column: int, rows: npt.NDArray[np.signedinteger] | None, findings: list[Finding]
) -> tuple[FloatArray, IntArray | None]:
    """Timestamps (n,) that go back here and there, in order, and the row numbers of that order where rows were late;
    where the clock was set back it continues by a usual step, and rows stay as they are.

    Sorting gives late rows even steps; rows of a clock that was set back have them in the order of the file. An uneven
    step is e times less likely than an even one, at least; timestamps of arrival that overtake one another have uneven
    steps in either order.

    Raises ``ReadError`` when time runs backward as a whole or jumps back further than a packet may be late.
    """
    step = np.diff(raw)
    back = np.flatnonzero(step < 0)
    if not len(back):
        return raw, None
    first, largest = int(back[0]) + 1, -float(step.min())
    place = _place(table, rows, first)
    if len(back) > 0.5 * len(step):
        raise ReadError(
            f"{table.path}: time runs backward ({len(back)} of {len(step)} steps, first at {place}); "
            "the rows stand in reverse order or column "
            f"{table.label(column)} is not a time: turn the rows round or name another time column."
        )
    order, usual = np.argsort(raw, kind="stable"), usual_step(raw)
    displaced = int(np.abs(order - np.arange(len(order))).max())
    if displaced > MAX_DISPLACEMENT:
        raise ReadError(
            f"{table.path}: the clock jumps back by {largest:.6g} (in its own unit) at "
            f"{_place(table, rows, int(np.argmin(step)) + 1)}: two recordings in one file, or a clock that "
            "was set; cut the file there."
        )
    if _n_uneven(np.diff(raw[order]), usual) - _n_uneven(step, usual) < LN_FAULT:
        said = Finding.of("time-backward", count=len(back), where=place, displaced_rows=displaced, sample=first)
        findings.append(said)
        return raw[order], order
    lifts = np.zeros(len(raw))
    lifts[back + 1] = usual - step[back]
    findings.append(Finding.of("time-backward", "set", count=len(back), where=place, largest=largest, sample=first))
    return raw + np.cumsum(lifts), None
