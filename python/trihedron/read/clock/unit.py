"""The unit of a time column: given, named, or inferred from step, digits, length and readings."""

import math
import re
from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.read.clock.rate import steps_of, usual_step
from trihedron.read.errors import ReadError
from trihedron.records import Finding, Severity
from trihedron.records.words import words

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "100us": 1e-4}
_CANDIDATES = ("s", "ms", "us", "ns")
PLAUSIBLE_HZ = (0.02, 20000.0)
_SLOW_TICKS = -1.0
"""Log odds of ticks below 2 Hz: such logs use seconds; a slow tick counter is rarer than one 1000 times faster."""
_BANDS: tuple[tuple[float, float], ...] = (
    (0.2, -5.0),
    (0.7, -3.0),
    (2.0, -1.0),
    (10.0, -1.5),
    (900.0, 0.0),
    (2100.0, -0.5),
    (2500.0, -1.5),
)
_BANDS += ((math.inf, -3.0),)
"""Log odds of a rate below each bound: loggers run between 10 Hz and 1 kHz, some at 1 Hz, hardly any below 0.2 Hz."""
_FRACTIONS = {"s": 0.0, "ms": -1.5, "us": -4.0, "ns": -6.0}
"""Log odds of decimal digits: seconds need them, tick counts have none (some programs print ms with them)."""
_NANOSECONDS = -2.0
"""Log odds of nanoseconds: they are logged as dates, which determine the unit, or named; seldom as a bare count."""
_SHORTEST_S, _SHORT = 5.0, -2.5
"""Shortest usual duration of a log of more than 1000 rows; the log odds of a unit that makes it shorter."""
_IMPOSSIBLE, _HASTY = -20.0, -4.0
QUICKEST_TURN_S, HASTY_TURN_S = 0.03, 0.12
"""Rotation by 20 degrees between static poses in the first time needs 1500 rad/s², more than a wrist or a table
reaches; in the second 100 rad/s², a shock."""
USUAL_TURN_S, _TURN_SPREAD, _SLOWEST = 0.35, math.log(3.0), -3.0
"""Usual time of a session's fastest 20 degrees (90 degrees in 1.5 s), the spread of its logarithm, and the lowest log
odds, because slow rotation in a chamber has no limit."""
FASTEST_KELVIN_S = 5.0
"""Fastest change of temperature [K/s] of a part in its case; a chamber reaches 0.1 K/s."""
_TURN_DEG, _SIDE = 20.0, 5
_NEARLY_ALL = 0.95
_SURE = 3.9
"""Log odds at which a unit is certain: 50 to 1."""
_OTHER_TICK = -4.6
"""Log odds that whole numbers are ticks of another size (of 32768 Hz, 25 µs ...) without a name that says so: one log
in a hundred."""
TICKS = "tick"
"""Unit of a column whose name says that it counts ticks without stating their size."""
_TICK = re.compile(r"(1\s*/\s*)?(\d+(?:\.\d*)?(?:e[+-]?\d+)?)\s*(k?hz|s|ms|us|µs|ns)", re.IGNORECASE)
_LONG = {"min": 60.0, "minutes": 60.0, "h": 3600.0, "hours": 3600.0}
_MOST_ROWS = 200_000


@dataclass(frozen=True, eq=False)
class Witness:
    """Readings in row order that limit the time between rows: (n, 3) and (n,), or ``None``."""

    accelerometer: FloatArray | None = None
    temperature: FloatArray | None = None


def parse_time_unit(text: str) -> str:
    """The time unit that a user's text names."""
    words = {"sec": "s", "seconds": "s", "millis": "ms", "micros": "us", "µs": "us", "nanos": "ns"}
    unit = words.get(text.strip().lower(), text.strip().lower())
    if unit not in SECONDS and not seconds_of(unit) > 0.0:
        raise ReadError(f"'{text}' is not a time unit; use s, ms, us, ns, or the size of a tick: '32768 Hz', '25 us'.")
    return unit


def seconds_of(unit: str) -> float:
    """Seconds per unit (``ms``) or per tick (``32768 Hz``, ``1/32768 s``, ``25 us``); NaN for other texts."""
    tick = _TICK.fullmatch(unit.strip())
    if tick is None:
        return SECONDS.get(unit, _LONG.get(unit, math.nan))
    number, of = float(tick[2]), tick[3].lower().replace("µ", "u")
    if not number:
        return math.nan
    size = 1.0 / number if tick[1] else number
    hertz = {"hz": 1.0, "khz": 1e3}.get(of)
    return size * SECONDS[of] if hertz is None else 1.0 / (size * hertz)


def time_unit(
    raw: FloatArray, named: str, given: str | None, wraps: bool, witness: Witness, findings: list[Finding]
) -> str:
    """Unit of timestamps (n,) in order: given, named, from their date, or the most likely, stated as a finding."""
    if given is not None:
        unit = parse_time_unit(given)
        _weigh_given(raw, unit, named, findings)
        return unit
    if named and named != TICKS:
        return named
    n_steps, n_forward = len(raw) - 1, steps_of(raw).forward
    if not n_forward:
        return "s"
    # Where rows share timestamps, the time per row is the span over the number of rows, not the step of timestamps.
    shared = n_forward < 0.8 * n_steps
    usual = float((raw[-1] - raw[0]) / n_steps) if shared else usual_step(raw)
    start = float(raw[0])
    shortest, longest = 1.0 / PLAUSIBLE_HZ[1], 1.0 / PLAUSIBLE_HZ[0]
    possible = [u for u in _CANDIDATES if shortest <= usual * SECONDS[u] <= longest]
    # A date between 2001 and 2096 determines the unit; nothing else counts that high.
    dated = [u for u in _CANDIDATES if 1e9 <= start * SECONDS[u] <= 4e9]
    is_date_throughout = len(dated) == 1 and not wraps and raw[-1] * SECONDS[dated[0]] <= 4e9
    dated = [u for u in dated if u in possible] or (dated if is_date_throughout else [])
    if dated:
        choice, sure = dated[0], True
    elif possible:
        scores = _scores(raw, usual, possible, witness)
        ranked = sorted(possible, key=lambda u: -scores[u])
        choice = ranked[0]
        sure = len(ranked) == 1 or scores[choice] - scores[ranked[1]] > _SURE
        if choice != "s" and not _has_fractions(raw):
            sure = sure and named != TICKS and scores[choice] - _OTHER_TICK > _SURE
        sure = sure and not counts_rows(raw)
        possible = [u for u in ranked if scores[u] > scores[choice] - 2.0 * _SURE]
    else:
        choice, sure = "s", 0.5 * usual < 60.0
    tick_s = {"weighed_tick_s": SECONDS[choice]} if choice != "s" and not dated else {}
    findings.append(_statement(usual, choice, sure, possible, tick_s))
    return choice


def _weigh_given(raw: FloatArray, unit: str, named: str, findings: list[Finding]) -> None:
    """A finding where the unit that was given makes a rate that no sensor has."""
    span_s = float(raw[-1] - raw[0]) * seconds_of(unit)
    rate_hz = (len(raw) - 1) / span_s if span_s > 0.0 else 0.0
    if rate_hz and not PLAUSIBLE_HZ[0] <= rate_hz <= PLAUSIBLE_HZ[1]:
        is_named = bool(named) and named != unit
        said = Finding.of(
            "rate-contradicted", "time-unit", unit=unit, rows=len(raw), span_s=span_s, rate_hz=rate_hz,
            is_named=is_named, named=named if is_named else "s",
        )  # fmt: skip
        findings.append(said)


def _scores(raw: FloatArray, usual: float, possible: list[str], witness: Witness) -> dict[str, float]:
    """Log odds of every possible unit."""
    fractions = _has_fractions(raw)
    rest_to_rest, any_turn = _quickest_turns(witness.accelerometer)
    kelvin = _quickest_warming(witness.temperature)
    scores = {}
    for unit in possible:
        row_s = usual * SECONDS[unit]
        score = next(odds for bound, odds in _BANDS if 1.0 / row_s < bound)
        score += _FRACTIONS[unit] if fractions else 0.0
        score += _SLOW_TICKS if unit != "s" and row_s > 0.5 else 0.0
        score += _NANOSECONDS if unit == "ns" else 0.0
        if len(raw) > 1000 and len(raw) * row_s < _SHORTEST_S:
            score += _SHORT
        if rest_to_rest is not None and rest_to_rest * row_s < HASTY_TURN_S:
            score += _IMPOSSIBLE if rest_to_rest * row_s < QUICKEST_TURN_S else _HASTY
        if any_turn is not None and any_turn * row_s > USUAL_TURN_S:
            score += max(-0.5 * (math.log(any_turn * row_s / USUAL_TURN_S) / _TURN_SPREAD) ** 2, _SLOWEST)
        if kelvin is not None and kelvin / row_s > FASTEST_KELVIN_S:
            score += _IMPOSSIBLE
        scores[unit] = score
    return scores


def _has_fractions(raw: FloatArray) -> bool:
    return bool(np.any(raw[:_MOST_ROWS] != np.rint(raw[:_MOST_ROWS])))


def counts_rows(raw: FloatArray) -> bool:
    """Whether numbers (n,) increase by 1 in nearly every row: a sample counter, or ticks of one row each."""
    return len(raw) > 2 and not _has_fractions(raw) and bool(np.mean(np.diff(raw[:_MOST_ROWS]) == 1.0) > _NEARLY_ALL)


def was_weighed(finding: Finding) -> bool:
    """Whether a finding states that the unit of whole-numbered timestamps was inferred."""
    return finding.code == "time-unit-detected" and "weighed_tick_s" in finding.numbers


def with_gyro(findings: list[Finding], is_confirmed: bool) -> list[Finding]:
    """Findings with the warning of an uncertain time unit made serious, because the gyro's scale depends on it, or made
    a note where the rotation of gravity confirms it."""
    severity = Severity.NOTE if is_confirmed else Severity.SERIOUS
    return [
        replace(f, severity=severity) if f.code == "time-unit-detected" and f.severity is Severity.WARNING else f
        for f in findings
    ]


def _quickest_turns(accelerometer: FloatArray | None) -> tuple[int | None, int | None]:
    """Smallest number of rows in which gravity rotates by 20 degrees: between two static sections, and anywhere.

    A section is five rows; it is static if it rotates ten times slower than between the two, so no rate is needed.
    """
    if accelerometer is None:
        return None, None
    return _core.quickest_turns(accelerometer[:_MOST_ROWS], _SIDE, math.radians(_TURN_DEG))


def _quickest_warming(temperature: FloatArray | None) -> float | None:
    """Largest change of temperature [K/row] between fiftieths of the log, over which thermometer noise averages out."""
    if temperature is None or len(temperature) < 500:
        return None
    n = len(temperature) // 50
    parts = temperature[: n * 50].reshape(50, n)
    if not np.isfinite(parts).any(axis=1).all():
        return None
    blocks = np.nanmean(parts, axis=1)
    return float(np.abs(np.diff(blocks)).max() / n)


def _statement(usual: float, choice: str, sure: bool, possible: list[str], tick_s: dict[str, float]) -> Finding:
    rate = 1.0 / (usual * SECONDS[choice])
    others = [words("unit-with-rate", unit=u, rate_hz=1.0 / (usual * SECONDS[u])) for u in possible if u != choice]
    return Finding.of(
        "time-unit-detected",
        "" if sure else "unsure",
        numbers=tick_s,
        step=usual,
        unit=choice,
        rate_hz=rate,
        others=others,
        has_others=bool(others),
    )
