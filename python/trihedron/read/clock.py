"""The time base: unit, start, wraps, order; and two clocks merged into one."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from trihedron.read.errors import ReadError
from trihedron.read.table import FloatArray, Table
from trihedron.records import Finding, FindingCode, Severity

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "100us": 1e-4}
PLAUSIBLE_HZ = (2.0, 20000.0)
MAX_DISPLACEMENT = 64
"""Rows a packet may arrive late. Anything further is another recording, not another order."""
_LONGEST_S = 3.2e9
"""A century."""
_MODULI = (2.0**16, 2.0**24, 2.0**32)


@dataclass(frozen=True, eq=False)
class Clock:
    """``time_s`` (n,) from the first sample on, ``start_s`` the clock's reading there, ``rows`` (n,) the table rows."""

    time_s: FloatArray
    start_s: float
    rows: npt.NDArray[np.int64] | None
    findings: tuple[Finding, ...]


def parse_time_unit(text: str) -> str:
    """A user's unit word."""
    words = {"sec": "s", "seconds": "s", "millis": "ms", "micros": "us", "µs": "us", "nanos": "ns"}
    unit = words.get(text.strip().lower(), text.strip().lower())
    if unit not in SECONDS:
        raise ReadError(f"'{text}' is not a time unit; use s, ms, us or ns.")
    return unit


def build_clock(table: Table, column: int, named: str, given: str | None, nanoseconds: int | None = None) -> Clock:
    """Seconds from a time column, or from whole seconds and a column of ``nanoseconds`` beside them.

    Raises
    ------
    ReadError
        When the column is constant, runs backward as a whole, or jumps back further than rows can be late.
    """
    raw = table.columns[column]
    base = 0.0
    if nanoseconds is not None:
        # Relative to the first second, so that no digit of the nanoseconds is lost.
        base = float(raw[0]) if np.isfinite(raw[0]) else 0.0
        raw = (raw - base) + 1e-9 * table.columns[nanoseconds]
        named = "s"
    findings: list[Finding] = []
    rows: npt.NDArray[np.int64] | None = None
    finite = np.isfinite(raw)
    if not finite.all():
        bad = int(np.flatnonzero(~finite)[0])
        if finite.sum() < 2:
            raise ReadError(f"{table.path}: the time column {table.label(column)} holds no numbers; name another one.")
        findings.append(
            Finding(
                FindingCode.NON_FINITE,
                Severity.WARNING,
                f"{int((~finite).sum())} rows have no time (first: {table.place(bad)}) and were left out.",
                "Damaged rows.",
                "Check the logger.",
                MappingProxyType({"count": float((~finite).sum()), "row": float(bad)}),
            )
        )
        rows = np.flatnonzero(finite)
        raw = raw[rows]
    if len(raw) > 1 and np.all(raw == raw[0]):
        raise ReadError(
            f"{table.path}: the time column {table.label(column)} holds {raw[0]:.12g} in every row; "
            "choose another with --columns time=..., or --columns time=none with --rate."
        )
    raw, wraps = _unwrap(raw, table, rows, findings)
    order = _order(raw, table, column, rows, findings) if len(raw) > 1 else None
    if order is not None:
        raw = raw[order]
        rows = order if rows is None else rows[order]
    unit = _time_unit(raw, named, given, wraps, findings)
    scale = SECONDS[unit]
    if not (raw[-1] - raw[0]) * scale < _LONGEST_S:
        raise ReadError(
            f"{table.path}: column {table.label(column)} read as time in {unit} spans "
            f"{(raw[-1] - raw[0]) * scale:.3g} s, which no log does; give --time-unit, or name another time column."
        )
    return Clock((raw - raw[0]) * scale, float(base + raw[0]) * scale, rows, tuple(findings))


def _place(table: Table, rows: npt.NDArray[np.int64] | None, sample: int) -> str:
    return table.place(int(rows[sample]) if rows is not None else sample)


def _unwrap(
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
                Finding(
                    FindingCode.TIME_WRAPPED,
                    Severity.NOTE,
                    f"The clock counter of {int(np.log2(modulus))} bits starts again from zero {len(back)} times "
                    f"(first: {_place(table, rows, int(back[0]) + 1)}); the time was continued.",
                    numbers=MappingProxyType({"count": float(len(back)), "sample": float(back[0] + 1)}),
                )
            )
            return raw + np.cumsum(turns), True
    return raw, False


def _order(
    raw: FloatArray, table: Table, column: int, rows: npt.NDArray[np.int64] | None, findings: list[Finding]
) -> npt.NDArray[np.int64] | None:
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
        Finding(
            FindingCode.TIME_BACKWARD,
            Severity.WARNING,
            f"Time runs backward at {len(back)} places (first: {place}); the rows were sorted by time, none moved "
            f"further than {displaced} rows.",
            "Packets that overtook each other.",
            "If the rows stand in the right order and the stamps are wrong, read with --columns time=none and --rate.",
            MappingProxyType({"count": float(len(back)), "sample": float(first), "displaced_rows": float(displaced)}),
        )
    )
    return order


def _time_unit(raw: FloatArray, named: str, given: str | None, wraps: bool, findings: list[Finding]) -> str:
    if given is not None:
        return parse_time_unit(given)
    if named:
        return named
    step = np.diff(raw)
    positive = step[step > 0]
    if not len(positive):
        return "s"
    usual = float(np.median(positive))
    start = float(raw[0])
    # A date between 2001 and 2096 in the unit settles it; nothing else counts that high.
    dated = [unit for unit in ("s", "ms", "us", "ns") if 1e9 <= start * SECONDS[unit] <= 4e9]
    possible = [u for u in ("s", "ms", "us", "ns") if PLAUSIBLE_HZ[0] <= 1.0 / (usual * SECONDS[u]) <= PLAUSIBLE_HZ[1]]
    dated = [u for u in dated if u in possible] or (dated if len(dated) == 1 and not wraps else [])
    if dated:
        choice, sure = dated[0], True
    elif possible:
        # Two units a factor 1000 apart can both be plausible; ordinary loggers run between 10 Hz and 2 kHz.
        ordinary = [u for u in possible if 10.0 <= 1.0 / (usual * SECONDS[u]) <= 2000.0]
        choice = (ordinary or possible)[0]
        sure = len(possible) == 1
    else:
        choice, sure = "s", 0.5 * usual < 60.0
    rate = 1.0 / (usual * SECONDS[choice])
    others = [f"{u} ({1.0 / (usual * SECONDS[u]):.4g} Hz)" for u in possible if u != choice]
    findings.append(
        Finding(
            FindingCode.TIME_UNIT_DETECTED,
            Severity.NOTE if sure else Severity.WARNING,
            f"The time column steps by {usual:.6g}, so its unit is {choice} ({rate:.5g} Hz)"
            + (f"; {', '.join(others)} would be possible too." if others else "."),
            "" if sure else "The step alone does not tell the unit.",
            "" if sure else "Say it with --time-unit s, ms, us or ns if this is wrong.",
            MappingProxyType({"rate_hz": rate, "step": usual}),
        )
    )
    return choice


def mean_rate_hz(time_s: FloatArray) -> float:
    """Samples per second outside gaps: stamps rounded to a millisecond or batched do not bias it."""
    step = np.diff(time_s)
    positive = step[step > 0]
    usual = float(np.median(positive))
    if np.count_nonzero(step == 0) > 0.2 * len(step):
        # Stamped in batches: samples before the last stamp, over the time they took.
        before_last = int(np.searchsorted(time_s, time_s[-1]))
        return before_last / float(step[step <= 5.0 * usual].sum())
    inside = step[step <= 1.5 * usual]
    return len(inside) / float(inside.sum())
