"""Readings that no motion explains: their rows are excluded, and so missing for every stage.

A log's motion moves all axes of a sensor, and a sample's neighbours with it. A reading of a bus or a logger that failed
does not: it leaps away alone, keeps a value while noise moves the others, or comes out at the other end of the range.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np

from trihedron import _core
from trihedron.arrays import AXES, TINY, BoolArray, FloatArray, IntArray
from trihedron.channel_facts.quiet import Windows, look
from trihedron.channel_facts.static_axes import adc_steps
from trihedron.probability import LN_FAULT
from trihedron.quantiles import median
from trihedron.ranges import edges_of
from trihedron.read.audit.readings import short
from trihedron.read.audit.repeats import Repeats, copied_rows, longest_by_chance
from trihedron.read.sensors import Sensors
from trihedron.records import Finding, Severity

LONG, HALF = 0.1, 0.5
"""Shares of a log that are invalid, from which on the finding is serious, and nothing is excluded."""


def without_invalid(sensors: Sensors, rate_hz: float) -> tuple[Sensors, list[Finding]]:
    """The sensors without rows of invalid readings, and findings that state them."""
    windows = look(sensors.triads, rate_hz)
    if windows is None or len(sensors.time_s) < FEWEST:
        return sensors, []
    single: list[BoolArray] = []
    wrapped: list[BoolArray] = []
    copied: list[BoolArray] = []
    stuck: list[tuple[Finding, BoolArray]] = []
    for sensor, readings in sensors.triads.items():
        step = adc_steps(readings)
        noise = np.maximum(np.maximum(windows.quiet_noise(sensor), step), TINY)
        over = wrapped_rows(readings, noise)
        alone = np.zeros(len(over), dtype=np.bool_)
        alone[~over] = isolated_rows(readings[~over] if over.any() else readings, noise, step)
        wrapped.append(over)
        copied.append(copied_rows(readings))
        single.append(alone)
        stuck += _stuck(sensor, readings, step, windows, sensors)
    findings = [finding for finding, _ in stuck]
    for case, rows in (("wrapped", wrapped), ("copied", copied), ("isolated", single)):
        if np.any(rows):
            findings.append(_invalid(case, rows, sensors))
    bad = np.any([*single, *wrapped, *copied, *(rows for _, rows in stuck)], axis=0)
    if not findings or bad.mean() >= HALF:
        return sensors, findings
    numbers = MappingProxyType({**findings[0].numbers, "rows_left_out": float(bad.sum())})
    return _at(sensors, np.flatnonzero(~bad)), [replace(findings[0], numbers=numbers), *findings[1:]]


FEWEST = 64
"""Rows of a log below which its noise is not known well enough to judge single readings."""


def _invalid(case: str, rows: list[BoolArray], sensors: Sensors) -> Finding:
    """The finding of invalid ``rows`` (n,) of each sensor."""
    every = np.any(rows, axis=0)
    of_each = zip(sensors.triads, rows, strict=True)
    return Finding.of(
        "invalid-readings",
        case,
        severity=Severity.WARNING if every.mean() < LONG else Severity.SERIOUS,
        counts=[(short(sensor), int(one.sum())) for sensor, one in of_each if one.any()],
        count=int(np.sum(rows)),
        where=sensors.place(int(np.argmax(every))),
        sample=int(np.argmax(every)),
    )


def _at(sensors: Sensors, samples: IntArray) -> Sensors:
    """The sensors at some of their samples (k,), in order; what is lost between them counts as lost before."""
    rows = np.arange(len(sensors.time_s)) + sensors.offset if sensors.rows is None else sensors.rows[sensors.offset :]
    lost = None
    if sensors.lost_behind is not None:
        lost = np.diff(np.concatenate([[0], np.cumsum(sensors.lost_behind)])[samples]) + np.diff(samples) - 1
    return replace(
        sensors,
        time_s=sensors.time_s[samples],
        accelerometer=None if sensors.accelerometer is None else sensors.accelerometer[samples],
        gyroscope=None if sensors.gyroscope is None else sensors.gyroscope[samples],
        rows=rows[samples],
        offset=0,
        lost_behind=lost,
        timestamps_s=None if sensors.timestamps_s is None else sensors.timestamps_s[samples],
        rows_read=sensors.rows_read - len(sensors.time_s) + len(samples),
    )


# Isolated readings: a mixture of errors and of shocks that last for one sample.

_LEAST = 8.0
"""Standard errors of a leap, which noise does not reach."""
_ALIGNED = 0.02
"""Angle between a sensor's axis and a shock that acts along it, as on a table below the sensor, rad."""
_LN_SIZES, _LN_CODES = np.log(10.0), 16.0 * np.log(2.0)
"""Logarithms of the e-folds over which sizes of leaps are alike a priori, and of the values that a code has."""
_LN_SURE = np.log(100.0)


def isolated_rows(readings: FloatArray, noise: FloatArray, step: FloatArray) -> BoolArray:
    """(n,) rows of a triad (n, 3) in which one axis alone, or all axes with one code, leap away and back.

    A shock has any direction, or is along an axis to within its alignment; an error leaves the other axes to their
    noise (3,), or writes one code for all, of LSB ``step`` (3,). Its share of the leaps is unknown.
    """
    at, away, error = _core.triad_leaps(readings, np.ascontiguousarray(noise), _LEAST)
    out = np.zeros(len(readings), dtype=np.bool_)
    if not len(at):
        return out
    size, z = np.linalg.norm(away, axis=1), away / error
    axis = np.abs(z).argmax(axis=1)
    others = np.array([np.delete(np.arange(3), k) for k in range(3)])[axis]
    alone, z2 = (np.take_along_axis(one, others, axis=1) for one in (error, z**2))
    along = np.abs(np.take_along_axis(away, axis[:, None], axis=1))
    # Logarithms of likelihood ratios to a shock of any direction, and to one along the axis.
    of_any = (
        np.log(4.0 * np.pi * size**3 / (6.0 * along[:, 0])) - np.sum(np.log(2.0 * np.pi * alone**2) + z2, axis=1) / 2
    )
    lean2 = (_ALIGNED * along / alone) ** 2
    of_aligned = np.sum(np.log1p(lean2) - z2 * lean2 / (1.0 + lean2), axis=1) / 2
    is_code = (readings[at] == readings[at, :1]).all(axis=1) & (step > 0.0).all()
    of_code = np.log(4.0 * np.pi * size**3) + _LN_SIZES - np.log(np.maximum(step, np.finfo(float).tiny)).sum()
    of_code -= np.where(readings[at, 0] == 0.0, np.log(2.0), np.log(2.0) + _LN_CODES)
    ratio = np.log(2.0) - np.logaddexp(-of_any, -of_aligned)
    ratio = np.where(is_code, np.maximum(ratio, of_code), ratio)
    shares = np.linspace(0.005, 0.995, 100)
    evidence = np.logaddexp(np.log(shares) + ratio[:, None], np.log1p(-shares)).sum(axis=0)
    best = int(evidence.argmax())
    if np.logaddexp.reduce(evidence) - np.log(len(shares)) > LN_FAULT:
        out[at[ratio + np.log(shares[best] / (1.0 - shares[best])) > _LN_SURE]] = True
    return out


# Overflow: readings beyond the range of their code come out at its other end.


_RANGE = 100.0
"""Smallest range of a code in noise of one sample: eight bits whose last one the noise moves have more."""


def wrapped_rows(readings: FloatArray, noise: FloatArray) -> BoolArray:
    """(n,) rows of a triad (n, 3) in which an axis differs from the motion by the range of its code."""
    out = np.zeros(len(readings), dtype=np.bool_)
    ends = _core.triad_extremes(readings)
    for k, (step, (low, _, high, _)) in enumerate(zip(_core.triad_largest_steps(readings), ends, strict=True)):
        if high - low >= _RANGE * noise[k] and step > 0.5 * (high - low):
            out |= _wrapped(readings[:, k], float(noise[k]), high - low)
    return out


def _wrapped(values: FloatArray, noise: float, span: float) -> BoolArray:
    """(n,) readings of one axis (n,), which covers ``span``, that differ from the motion by the range of their code.

    Its jumps are all of one size, that of the range, to within the unevenness of the motion beside them.
    """
    out = np.zeros(len(values), dtype=np.bool_)
    present = np.flatnonzero(np.isfinite(values))
    change = np.diff(values[present])
    at = 2 + np.flatnonzero(np.abs(change[2:-2]) > 0.5 * span)
    if len(present) < FEWEST or len(at) < 2:
        return out
    # The readings stop short of the range, by the motion's own step: the second round has it.
    for _ in range(2):
        moved = change - span * np.round(change / span)
        usual, error = 0.5 * (moved[at - 1] + moved[at + 1]), np.hypot(2.0 * noise, moved[at + 1] - moved[at - 1])
        sizes = np.abs(change[at] - usual)
        ratio = np.log(span / error) - 0.5 * ((sizes - span) / error) ** 2 - 0.5 * np.log(2.0 * np.pi)
        span = max(median(sizes[ratio > 0.0]), span) if np.any(ratio > 0.0) else span
    # A jump beside another one is there and back: an isolated reading, which proves no range.
    is_run = ~np.isin(at - 1, at) & ~np.isin(at + 1, at)
    if ratio[is_run & (ratio > 0.0)].sum() <= LN_FAULT:
        return out
    turns = np.concatenate([[0], np.cumsum(np.round(change / span))])
    kinds, count = np.unique(turns, return_counts=True)
    out[present[turns != kinds[count.argmax()]]] = True
    return out


# Stuck: a value is kept while noise would change it.


def _stuck(
    sensor: str, readings: FloatArray, step: FloatArray, windows: Windows, sensors: Sensors
) -> list[tuple[Finding, BoolArray]]:
    """A finding for each axis, or for the triad, that keeps a value far longer than by chance, with its rows (n,).

    Where the LSB exceeds the noise, a value may be constant for a whole pose; then the other axes must move. A value
    kept at an end of the range is clipped, not stuck.
    """
    repeats, noise, out = Repeats(readings), windows.quiet_noise(sensor), []
    for k in (3, 0, 1, 2):
        start, longest = int(repeats.longest_start[k]), int(repeats.longest[k])
        limit = longest_by_chance(repeats.n, repeats.chance_outside(k, start, longest))
        if longest <= (limit if k == 3 else max(limit, 2.0 * repeats.longest[3])):
            continue
        column = readings if k == 3 else readings[:, k : k + 1]
        runs = edges_of((np.diff(column, axis=0) == 0.0).all(axis=1))
        runs = runs[runs[:, 1] - runs[:, 0] >= limit]
        ends = np.nanmin(column, axis=0), np.nanmax(column, axis=0)
        is_end = ((column[runs[:, 0]] == ends[0]) | (column[runs[:, 0]] == ends[1])).any(axis=1)
        runs = np.array([run for run in runs[~is_end] if _is_seen(run, k, readings, step, noise)], dtype=np.int64)
        if not len(runs):
            continue
        rows = np.zeros(len(readings), dtype=np.bool_)
        for first, last in runs.tolist():
            rows[first + 1 : last + 1] = True
        out.append((_stuck_finding(sensor, k, readings, runs, sensors), rows))
    return out


def _is_seen(run: IntArray, k: int, readings: FloatArray, step: FloatArray, noise: FloatArray) -> bool:
    """Whether noise, or motion on the other axes, would have changed axis ``k`` (3: the triad) in a run."""
    if k == 3:
        return bool(np.any(step <= 2.0 * noise))
    others = [j for j in range(3) if j != k]
    stretch = readings[run[0] : run[1] + 1, others]
    stretch = stretch[np.isfinite(stretch).all(axis=1)]
    spread = stretch.std(axis=0) if len(stretch) else np.zeros(2)
    return bool(step[k] <= 2.0 * noise[k] or np.any(spread > 5.0 * np.maximum(noise[others], step[others])))


def _stuck_finding(sensor: str, k: int, readings: FloatArray, runs: IntArray, sensors: Sensors) -> Finding:
    length = runs[:, 1] - runs[:, 0]
    first = int(runs[length.argmax(), 0])
    return Finding.of(
        "stuck-values",
        severity=Severity.WARNING if length.sum() < LONG * len(readings) else Severity.SERIOUS,
        sensor=short(sensor),
        is_triad=k == 3,
        axis_name=AXES[k % 3],
        value=readings[first, k % 3],
        longest_run=int(length.max()) + 1,
        count=int(length.sum()),
        is_excluded=bool(length.sum() < HALF * len(readings)),
        where=sensors.place(first),
        axis=k,
        sample=first,
    )
