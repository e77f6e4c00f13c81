"""Which unit, which triad: decided by names, by what the user says, and by what the readings can only be."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from trihedron import _core
from trihedron.read.errors import ReadError
from trihedron.read.rest import Windows, is_integer, look
from trihedron.read.table import FloatArray
from trihedron.read.turning import turn_ratio as gyroscope_turns
from trihedron.read.turning import unit_by_turning
from trihedron.records import Finding, FindingCode, Severity
from trihedron.units import STANDARD_GRAVITY_M_S2, AccelerationUnit, RateUnit, acceleration_to_si, rate_to_si

NEAR_GRAVITY = 0.2
"""An uncalibrated accelerometer at rest may be this far off: scale a few per cent, zero offset a tenth of g."""
WHOLE = "whole numbers"
"""Stands for the unit of readings that were whole numbers before they were interpolated."""
MIN_TURNS = 3
MAX_TURN_RATIO = 2.0
"""Gravity's turn over the gyro's path: 1 at most by geometry, 1.1 with the scale errors of uncalibrated sensors."""
_ADVICE = {
    "accelerometer": "Say it with --accel-unit m/s^2, g, mg or counts if this is wrong.",
    "gyroscope": "Say it with --gyro-unit rad/s, mrad/s, deg/s or counts if this is wrong.",
}


@dataclass(frozen=True)
class Judged:
    """A unit and what to say about it."""

    unit: AccelerationUnit | RateUnit
    findings: tuple[Finding, ...]


def parse_acceleration_unit(text: str | AccelerationUnit) -> AccelerationUnit:
    """A user's unit word."""
    words = {"m/s2": "m/s^2", "m/s²": "m/s^2", "mps2": "m/s^2", "si": "m/s^2", "raw": "counts", "lsb": "counts"}
    key = text.value if isinstance(text, AccelerationUnit) else str(text).strip().lower()
    try:
        return AccelerationUnit(words.get(key, key))
    except ValueError:
        raise ReadError(f"'{text}' is not an acceleration unit; use m/s^2, g, mg or counts.") from None


def parse_rate_unit(text: str | RateUnit) -> RateUnit:
    """A user's unit word."""
    words = {"dps": "deg/s", "mdps": "mdeg/s", "°/s": "deg/s", "si": "rad/s", "raw": "counts", "lsb": "counts"}
    key = text.value if isinstance(text, RateUnit) else str(text).strip().lower()
    try:
        return RateUnit(words.get(key, key))
    except ValueError:
        raise ReadError(f"'{text}' is not an angular rate unit; use rad/s, mrad/s, deg/s, mdeg/s or counts.") from None


def _finding(code: FindingCode, severity: Severity, seen: str, cause: str, action: str, **numbers: float) -> Finding:
    return Finding(code, severity, seen, cause, action, MappingProxyType(numbers))


def rest_norm(readings: FloatArray, windows: Windows | None) -> float:
    """Median length of single accelerometer readings in quiet windows, raw unit.

    Of single readings, so that a table of pose means, where every row is another pose, gives the same.
    """
    if windows is None:
        return math.nan
    index = windows.start[windows.quiet][:, None] + np.arange(windows.length)
    return float(np.nanmedian(np.linalg.norm(readings[index], axis=2)))


def judge_accelerometer(
    readings: FloatArray, windows: Windows | None, named: str, given: str | AccelerationUnit | None
) -> Judged:
    """Unit of the accelerometer: as given, else as named, else from |a| at rest."""
    norm = rest_norm(readings, windows)
    whole = is_integer(readings) or named == WHOLE
    named = "" if named == WHOLE else named
    if given is not None or named not in {"", "raw"}:
        unit = parse_acceleration_unit(given if given is not None else named)
        source = "as you said" if given is not None else "by its column names"
        return Judged(unit, _stated("accelerometer", unit, source, _contradiction_accelerometer(unit, norm, source)))
    if whole and not _is_near(norm, 1.0):
        found = AccelerationUnit.COUNTS
        seen = "The accelerometer's readings are whole numbers and were taken as counts."
        if _is_near(norm, 1000.0):
            return Judged(
                found,
                (
                    _finding(
                        FindingCode.UNIT_ASSUMED,
                        Severity.WARNING,
                        f"The accelerometer reads whole numbers of length {norm:.4g} at rest: counts of about "
                        "1/1000 g, or mg; taken as counts.",
                        "Both look alike. The calibration differs only in its name of the raw unit.",
                        _ADVICE["accelerometer"],
                        rest_norm=norm,
                    ),
                ),
            )
        return Judged(found, (_finding(FindingCode.UNIT_DETECTED, Severity.NOTE, seen, "", "", rest_norm=norm),))
    for unit, length in (
        (AccelerationUnit.M_S2, STANDARD_GRAVITY_M_S2),
        (AccelerationUnit.G, 1.0),
        (AccelerationUnit.MG, 1000.0),
    ):
        if _is_near(norm, length):
            seen = f"The accelerometer reads {norm:.4g} at rest, so its unit is {unit.value}."
            return Judged(unit, (_finding(FindingCode.UNIT_DETECTED, Severity.NOTE, seen, "", "", rest_norm=norm),))
    if norm < 1.0 and not whole:
        return Judged(AccelerationUnit.M_S2, (_gravity_missing(norm),))
    if math.isnan(norm):
        seen = "The accelerometer has no stretch without missing readings to tell its unit by; taken as raw counts."
    else:
        seen = (
            f"The accelerometer reads {norm:.4g} in its quietest stretches, which is gravity in no known unit; "
            "taken as raw counts."
        )
    cause = "A raw reading of unknown scale, a log that never rests, or wrong columns."
    return Judged(
        AccelerationUnit.COUNTS,
        (_finding(FindingCode.UNIT_ASSUMED, Severity.WARNING, seen, cause, _ADVICE["accelerometer"], rest_norm=norm),),
    )


def _is_near(value: float, target: float) -> bool:
    return abs(value - target) <= NEAR_GRAVITY * target


def _gravity_missing(norm: float) -> Finding:
    return _finding(
        FindingCode.GRAVITY_MISSING,
        Severity.SERIOUS,
        f"The accelerometer reads only {norm:.3g} at rest: gravity is missing from it.",
        "'Linear' or 'user' acceleration of a phone, from which gravity was taken out, or wrong columns.",
        "Log the accelerometer itself; nothing here can be calibrated without gravity.",
        rest_norm=norm,
    )


def _contradiction_accelerometer(unit: AccelerationUnit, norm: float, source: str) -> Finding | None:
    scale = acceleration_to_si(unit)
    if scale is None or not math.isfinite(norm):
        return None
    si = norm * scale
    if 0.6 * STANDARD_GRAVITY_M_S2 <= si <= 1.5 * STANDARD_GRAVITY_M_S2:
        return None
    return _finding(
        FindingCode.UNIT_CONTRADICTED,
        Severity.SERIOUS,
        f"The accelerometer is in {unit.value} {source}, but at rest it reads {norm:.4g} {unit.value}, "
        f"{si / STANDARD_GRAVITY_M_S2:.3g} times gravity.",
        "A wrong unit, wrong columns, or a log that never rests.",
        _ADVICE["accelerometer"],
        rest_norm=norm,
    )


def _stated(
    sensor: str, unit: AccelerationUnit | RateUnit, source: str, against: Finding | None
) -> tuple[Finding, ...]:
    if against is not None:
        return (against,)
    return (_finding(FindingCode.UNIT_DETECTED, Severity.NOTE, f"The {sensor} is in {unit.value} {source}.", "", ""),)


def judge_gyroscope(
    readings: FloatArray,
    accelerometer: FloatArray | None,
    time_s: FloatArray,
    rate_hz: float,
    windows: Windows | None,
    named: str,
    given: str | RateUnit | None,
) -> Judged:
    """Unit of the gyro: as given, else as named, else by turning gravity, else by magnitude (a warning)."""
    by_turn: RateUnit | None = None
    evidence = ""
    whole = is_integer(readings) or named == WHOLE
    named = "" if named == WHOLE else named
    if accelerometer is not None and windows is not None and not whole:
        by_turn, evidence = unit_by_turning(accelerometer, readings, time_s, rate_hz, windows)
    if given is not None or named not in {"", "raw"}:
        unit = parse_rate_unit(given if given is not None else named)
        source = "as you said" if given is not None else "by its column names"
        against = None
        if unit is not RateUnit.COUNTS and by_turn not in {None, unit}:
            against = _finding(
                FindingCode.UNIT_CONTRADICTED,
                Severity.SERIOUS,
                f"The gyro is in {unit.value} {source}, but {evidence}.",
                "A wrong unit or a wrong sampling rate.",
                _ADVICE["gyroscope"],
            )
        elif unit is not RateUnit.COUNTS and by_turn is None and windows is not None and accelerometer is not None:
            against = _rate_contradiction(unit, gyroscope_turns(readings, time_s, windows), source)
        return Judged(unit, _stated("gyro", unit, source, against))
    if whole:
        seen = "The gyro's readings are whole numbers and were taken as counts."
        return Judged(RateUnit.COUNTS, (_finding(FindingCode.UNIT_DETECTED, Severity.NOTE, seen, "", ""),))
    if by_turn is not None:
        seen = f"The gyro's unit is {by_turn.value}: {evidence}."
        return Judged(by_turn, (_finding(FindingCode.UNIT_DETECTED, Severity.NOTE, seen, "", ""),))
    return _gyroscope_by_magnitude(readings, windows)


def _rate_contradiction(unit: RateUnit, turns: tuple[float, int], source: str) -> Finding | None:
    """Gravity cannot turn further than the gyro's path; where it does by far, unit or time base are wrong."""
    ratio, n_turns = turns
    scale = rate_to_si(unit) or math.nan
    factor = ratio / scale
    if n_turns < MIN_TURNS or not factor > MAX_TURN_RATIO:
        return None
    return _finding(
        FindingCode.UNIT_CONTRADICTED,
        Severity.SERIOUS,
        f"The gyro is in {unit.value} {source}, but in {n_turns} turns between rests gravity moved {factor:.3g} times "
        "as far as it can have.",
        "A wrong unit, or a time base or rate that is wrong by that factor.",
        "Check --time-unit, --rate and --gyro-unit: gyro scale is inversely proportional to the rate.",
        turn_ratio=factor,
        turns=float(n_turns),
    )


def _gyroscope_by_magnitude(readings: FloatArray, windows: Windows | None) -> Judged:
    # What was infinite is missing (NaN) by now.
    extremes = _core.triad_extremes(readings)
    largest = float(np.nanmax([max(high, -low) for low, _, high, _ in extremes]))
    rest = largest
    if windows is not None:
        rest = float(np.median(np.abs(windows.quiet_mean("gyroscope")).max(axis=1)))
    # A gyro at rest reads its bias: MEMS stay below about 10 deg/s (0.2 rad/s, 200 mrad/s); none measures 40 rad/s.
    if largest > 40.0:
        unit = RateUnit.MRAD_S if rest > 20.0 else RateUnit.DEG_S
    else:
        unit = RateUnit.RAD_S if rest < 0.1 else RateUnit.DEG_S
    return Judged(
        unit,
        (
            _finding(
                FindingCode.UNIT_ASSUMED,
                Severity.WARNING,
                f"Nothing states the gyro's unit; it reads {rest:.3g} at rest and {largest:.4g} at most, "
                f"so it was taken as {unit.value}.",
                "No unit in the header, and no turns between rests to settle it.",
                _ADVICE["gyroscope"],
                rest=rest,
                largest=largest,
            ),
        ),
    )


def order_of_triads(first: FloatArray, second: FloatArray, rate_hz: float) -> tuple[bool | None, str]:
    """Whether the first of two unnamed triads is the accelerometer (None: cannot tell), and why.

    At rest in different poses a gyro repeats its bias while an accelerometer points elsewhere; in one pose gravity
    still stands far higher above the accelerometer's noise than a bias does above the gyro's.
    """
    windows = look_at_pair(first, second, rate_hz)
    if windows is None:
        return None, "the log is too short to tell"
    change, level = [], []
    for name in ("first", "second"):
        noise = float(np.linalg.norm(windows.quiet_noise(name)))
        means = windows.quiet_mean(name)
        scale = max(noise, 1e-12 * float(np.abs(means).max(initial=0.0)), 1e-300)
        change.append(float(np.linalg.norm(means.std(axis=0))) / scale)
        level.append(float(np.median(np.linalg.norm(means, axis=1))) / scale)
    if max(change) > 5.0 and max(change) > 5.0 * min(change):
        return change[0] > change[1], "its quiet readings differ from pose to pose"
    if max(level) > 5.0 * min(level):
        return level[0] > level[1], "its steady reading stands far above its noise, as gravity does"
    return None, "both triads look alike"


def look_at_pair(first: FloatArray, second: FloatArray, rate_hz: float) -> Windows | None:
    """Windows of two triads not yet named."""
    return look({"first": first, "second": second}, rate_hz)
