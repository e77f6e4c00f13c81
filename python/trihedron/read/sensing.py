"""Units, and the order of unnamed triads: from names, from the user's options, and from the readings."""

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, FloatArray
from trihedron.channel_facts.limits import Extremes
from trihedron.channel_facts.quiet import Windows, is_integer, look
from trihedron.channel_facts.turning import Turning
from trihedron.read.errors import ReadError
from trihedron.read.names import known_unit
from trihedron.records import Finding
from trihedron.units import STANDARD_GRAVITY_M_S2, AccelerationUnit, RateUnit, acceleration_to_si

NEAR_GRAVITY = 0.2
"""Largest relative error of |a| of a static uncalibrated accelerometer: scale a few per cent, bias a tenth of g."""
MG_OR_GAL = 0.015
"""Relative difference from 980.665 cm/s^2 below which a norm near 1000 mg is ambiguous; the two differ by 0.02."""
GRAVITY_MISSING = 0.1
"""Static |a| in g, by the stated unit and gravity in no other, below which gravity was subtracted."""
WHOLE = "whole numbers"
"""Unit given to readings that were whole numbers before interpolation."""


@dataclass(frozen=True)
class Judged:
    """A unit and findings about it; ``confirms_clock``: gravity rotates as the gyro's stated unit and clock imply."""

    unit: AccelerationUnit | RateUnit
    findings: tuple[Finding, ...]
    confirms_clock: bool = False


_UNITS = {
    AccelerationUnit: ("accelerometer", "an acceleration unit", "--accel-unit"),
    RateUnit: ("gyroscope", "an angular rate unit", "--gyro-unit"),
}
Unit = TypeVar("Unit", AccelerationUnit, RateUnit)


def parse_unit(kind: type[Unit], text: str | Unit) -> Unit:
    """The unit of ``kind`` that a user's text names."""
    sensor, what, option = _UNITS[kind]
    try:
        return text if isinstance(text, kind) else kind(known_unit(sensor, text).replace("raw", "counts"))
    except ValueError:
        raise ReadError(
            f"'{text}' is not {what} known here; state one with {option}: "
            f"{', '.join(unit.value for unit in kind)} (counts: of any size)."
        ) from None


def static_norm(readings: FloatArray, windows: Windows | None) -> float:
    """Median norm of single accelerometer readings in quiet windows, raw unit.

    Single readings are used so that a table of pose means, with one pose per row, gives the same result.
    """
    if windows is None:
        return math.nan
    return _core.median_length(readings, windows.start[windows.quiet], windows.length)


def judge_accelerometer(
    readings: FloatArray, windows: Windows | None, named: str, given: str | AccelerationUnit | None
) -> Judged:
    """Unit of the accelerometer: as given, else as named, else from |a| in quiet windows."""
    norm = static_norm(readings, windows)
    stated = _stated(AccelerationUnit, named, given)
    fitting = of_gravity(norm)
    if stated is not None:
        gravities = norm * (acceleration_to_si(stated) or math.nan) / STANDARD_GRAVITY_M_S2
        if not (gravities < 0.6 or gravities > 1.5):
            return Judged(stated, (_statement("accelerometer", stated, given),))
        if fitting is None and gravities < GRAVITY_MISSING:
            return Judged(stated, (Finding.of("gravity-missing", static_norm=norm),))
        against = Finding.of(
            "unit-contradicted",
            "accelerometer",
            unit=stated.value,
            has_fitting=fitting is not None,
            fitting="" if fitting is None else fitting.value,
            is_given=given is not None,
            static_norm=norm,
            gravities=gravities,
        )
        return Judged(stated, (against,))

    unit = AccelerationUnit.COUNTS
    is_whole = is_integer(readings) or named == WHOLE
    if is_whole and fitting is not AccelerationUnit.G:
        found = Finding.of("unit-detected", "accelerometer-counts", static_norm=norm)
        if _is_near(norm, 1000.0):
            found = _alike(unit, norm, is_whole=True)
    elif fitting is not None:
        unit = fitting
        # A usual scale error makes mg and cm/s^2 indistinguishable.
        is_alike = fitting is AccelerationUnit.CM_S2 or abs(norm / _GRAVITY[AccelerationUnit.CM_S2] - 1.0) < MG_OR_GAL
        if is_alike:
            found = _alike(unit, norm, is_whole=False)
        else:
            found = Finding.of("unit-detected", "accelerometer-static", static_norm=norm, unit=unit.value)
    elif norm < 1.0 and not is_whole:
        unit = AccelerationUnit.M_S2
        found = Finding.of("gravity-missing", static_norm=norm)
    else:
        found = Finding.of("unit-assumed", "no-gravity", is_seen=not math.isnan(norm), static_norm=norm)
    return Judged(unit, (found,))


def _alike(unit: AccelerationUnit, norm: float, *, is_whole: bool) -> Finding:
    return Finding.of("unit-assumed", "alike", static_norm=norm, unit=unit.value, is_whole=is_whole)


_GRAVITY = {unit: STANDARD_GRAVITY_M_S2 / si for unit in AccelerationUnit if (si := acceleration_to_si(unit))}
"""Gravity in each unit."""


def of_gravity(norm: float) -> AccelerationUnit | None:
    """The unit in which a static norm is gravity; ``None`` where it is in none."""
    nearest = min(_GRAVITY, key=lambda unit: abs(norm - _GRAVITY[unit]))
    return nearest if _is_near(norm, _GRAVITY[nearest]) else None


def _is_near(value: float, target: float) -> bool:
    return abs(value - target) <= NEAR_GRAVITY * target


def _stated(kind: type[Unit], named: str, given: str | Unit | None) -> Unit | None:
    """The unit that is given, else named; None where neither states one."""
    said = named if given is None else given
    return None if given is None and named in {"", "raw", WHOLE} else parse_unit(kind, said)


def _statement(sensor: str, unit: AccelerationUnit | RateUnit, given: object) -> Finding:
    is_given = given is not None
    return Finding.of("unit-detected", "stated", sensor=sensor, unit=unit.value, is_given=is_given)


def judge_gyroscope(
    readings: FloatArray,
    turning: Turning | None,
    windows: Windows | None,
    named: str,
    given: str | RateUnit | None,
    extremes: Extremes,
) -> Judged:
    """Unit of the gyro: as given, named, by the rotation of gravity (``turning``), or by magnitude (a warning)."""
    stated = _stated(RateUnit, named, given)
    if stated is None and (is_integer(readings) or named == WHOLE):
        return Judged(RateUnit.COUNTS, (Finding.of("unit-detected", "gyro-counts"),))
    if stated is not None and (turning is None or stated is RateUnit.COUNTS):
        return Judged(stated, (_statement("gyro", stated, given),))
    if turning is None:
        return _gyroscope_by_magnitude(extremes, windows)
    nearest = min(turning.candidates, key=lambda one: abs(math.log(turning.factor(one))))
    unit = nearest if stated is None else stated
    factor = turning.factor(unit)
    percent, correlation = turning.percent, turning.correlation
    if turning.fits(unit) and stated is not None:
        found = _statement("gyro", unit, given)
    elif turning.fits(unit):
        found = Finding.of(
            "unit-detected", "gyro-by-turning", unit=unit.value, factor=factor, percent=percent, correlation=correlation
        )
    else:
        fitting = next((one.value for one in turning.candidates if turning.fits(one)), "")
        found = Finding.of(
            "unit-contradicted",
            "gyro-no-unit" if stated is None else "gyro-by-turning",
            has_fitting=bool(fitting),
            fitting=fitting,
            is_given=given is not None,
            unit=unit.value,
            factor=factor,
            right_hz=turning.rate_hz / factor,
            percent=percent,
            correlation=correlation,
        )
    return Judged(unit, (found,))


_RATES = (
    (RateUnit.RAD_S, 0.1, 70.0),
    (RateUnit.DEG_S, 20.0, 4000.0),
    (RateUnit.MRAD_S, 200.0, 70e3),
    (RateUnit.MDEG_S, math.inf, math.inf),
)
"""Units, the largest the first, with what a static gyro reads at most (its bias, for MEMS below about 10 deg/s), and
what any does: no MEMS measures more than 4000 deg/s."""


def _gyroscope_by_magnitude(extremes: Extremes, windows: Windows | None) -> Judged:
    largest = float(np.nanmax([max(high, -low) for low, _, high, _ in extremes]))
    rest = largest
    if windows is not None:
        rest = float(np.median(np.abs(windows.quiet_mean("gyroscope")).max(axis=1)))
    unit = next(one for one, at_rest, most in _RATES if not (rest >= at_rest or largest > most))
    return Judged(unit, (Finding.of("unit-assumed", "gyro", static=rest, largest=largest, unit=unit.value),))


def order_of_triads(first: FloatArray, second: FloatArray, rate_hz: float) -> tuple[bool | None, str]:
    """Whether the first of two unnamed triads is the accelerometer (None: undecided), and the catalogue's reason.

    From pose to pose the means of an accelerometer change and those of a gyro do not; in a single pose the ratio of
    gravity to the accelerometer's noise is far higher than that of the gyro's bias to its noise.
    """
    windows = look({"first": first, "second": second}, rate_hz)
    if windows is None:
        return None, "short"
    change, level = [], []
    for name in ("first", "second"):
        noise = float(np.linalg.norm(windows.quiet_noise(name)))
        means = windows.quiet_mean(name)
        scale = max(noise, 1e-12 * float(np.abs(means).max(initial=0.0)), TINY)
        change.append(float(np.linalg.norm(means.std(axis=0))) / scale)
        level.append(float(np.median(np.linalg.norm(means, axis=1))) / scale)
    if max(change) > 5.0 and max(change) > 5.0 * min(change):
        return change[0] > change[1], "poses"
    if max(level) > 5.0 * min(level):
        return level[0] > level[1], "level"
    return None, "alike"
