"""Units: the only place where a number changes its unit.

Inside the package everything is SI (m/s², rad/s, s, °C) except *raw* sensor readings, which stay in the unit of the
log, so that a calibration maps the logged values themselves.
"""

import math
from enum import Enum

from trihedron.errors import InputError

STANDARD_GRAVITY_M_S2 = 9.80665
"""Conventional value that defines the unit ``g``; local gravity differs."""


class AccelerationUnit(str, Enum):
    """Unit of raw accelerometer readings."""

    M_S2 = "m/s^2"
    G = "g"
    MG = "mg"
    CM_S2 = "cm/s^2"
    COUNTS = "counts"


class RateUnit(str, Enum):
    """Unit of raw gyro readings."""

    RAD_S = "rad/s"
    MRAD_S = "mrad/s"
    DEG_S = "deg/s"
    MDEG_S = "mdeg/s"
    DEG_H = "deg/h"
    RPM = "rpm"
    COUNTS = "counts"


_ACCELERATION_TO_SI = {
    AccelerationUnit.M_S2: 1.0,
    AccelerationUnit.G: STANDARD_GRAVITY_M_S2,
    AccelerationUnit.MG: STANDARD_GRAVITY_M_S2 / 1000.0,
    AccelerationUnit.CM_S2: 0.01,
}
_RATE_TO_SI = {
    RateUnit.RAD_S: 1.0,
    RateUnit.MRAD_S: 1e-3,
    RateUnit.DEG_S: math.pi / 180.0,
    RateUnit.MDEG_S: math.pi / 180.0e3,
    RateUnit.DEG_H: math.pi / 180.0 / 3600.0,
    RateUnit.RPM: 2.0 * math.pi / 60.0,
}


def acceleration_to_si(unit: AccelerationUnit) -> float | None:
    """Nominal m/s² per unit; ``None`` for counts, whose scale only a calibration determines."""
    return _ACCELERATION_TO_SI.get(unit)


def rate_to_si(unit: RateUnit) -> float | None:
    """Nominal rad/s per unit; ``None`` for counts."""
    return _RATE_TO_SI.get(unit)


def si_of(unit: str) -> float | None:
    """Nominal SI per unit of an accelerometer or a gyro, by its name; ``None`` for counts."""
    return {one.value: size for table in (_ACCELERATION_TO_SI, _RATE_TO_SI) for one, size in table.items()}.get(unit)


def ratio_of_units(one: AccelerationUnit | RateUnit, other: AccelerationUnit | RateUnit) -> float | None:
    """Size of the unit ``one`` in ``other``; ``None`` between quantities, and between counts and another unit."""
    if one is other:
        return 1.0
    if isinstance(one, AccelerationUnit) and isinstance(other, AccelerationUnit):
        si = acceleration_to_si(one), acceleration_to_si(other)
    elif isinstance(one, RateUnit) and isinstance(other, RateUnit):
        si = rate_to_si(one), rate_to_si(other)
    else:
        return None
    return None if si[0] is None or si[1] is None else si[0] / si[1]


def rate_lsb_to_si(text: str) -> float:
    """LSB of a gyro, as in ``0.05 deg/s``, in rad/s.

    Raises ``InputError`` when it is not a positive number and a unit.
    """
    value, unit = _value_and_unit(text, [u.value for u in _RATE_TO_SI])
    return value * _RATE_TO_SI[RateUnit(unit)]


def acceleration_lsb_to_si(text: str) -> float:
    """LSB of an accelerometer, as in ``3.33 mg``, in m/s².

    Raises ``InputError`` when it is not a positive number and a unit.
    """
    value, unit = _value_and_unit(text, [u.value for u in _ACCELERATION_TO_SI])
    return value * _ACCELERATION_TO_SI[AccelerationUnit(unit)]


def _value_and_unit(text: str, units: list[str]) -> tuple[float, str]:
    unit = next((u for u in sorted(units, key=len, reverse=True) if text.strip().endswith(u)), "")
    try:
        value = float(text.strip().removesuffix(unit)) if unit else math.nan
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"the size of a count is a number and a unit ({', '.join(units)}), not {text!r}")
    return value, unit


def degrees_from_radians(angle_rad: float) -> float:
    """Angle or rate, rad → deg."""
    return math.degrees(angle_rad)


def radians_from_degrees(angle_deg: float) -> float:
    """Angle or rate, deg → rad."""
    return math.radians(angle_deg)


def mg_from_m_s2(acceleration_m_s2: float) -> float:
    """Acceleration in thousandths of standard gravity."""
    return 1000.0 * acceleration_m_s2 / STANDARD_GRAVITY_M_S2


def m_s2_from_micro_g(acceleration_micro_g: float) -> float:
    """Acceleration in millionths of standard gravity → m/s²."""
    return 1e-6 * acceleration_micro_g * STANDARD_GRAVITY_M_S2


def mm_s2_from_m_s2(acceleration_m_s2: float) -> float:
    """Acceleration, m/s² → mm/s²."""
    return 1000.0 * acceleration_m_s2


def mrad_from_radians(angle_rad: float) -> float:
    """Angle, rad → mrad."""
    return 1000.0 * angle_rad


def cm_from_m(length_m: float) -> float:
    """Centimetres from metres."""
    return 100.0 * length_m


def ms_from_s(time_s: float) -> float:
    """Time, s → ms."""
    return 1000.0 * time_s


def per_root_hour(per_root_second: float) -> float:
    """Random walk of an integral, 1/√s → 1/√h."""
    return 60.0 * per_root_second


def per_hour(per_second: float) -> float:
    """Rate, 1/s → 1/h."""
    return 3600.0 * per_second


def arcsec_from_radians(angle_rad: float) -> float:
    """Angle, rad → arc seconds."""
    return 3600.0 * math.degrees(angle_rad)


def micro_g_from_m_s2(acceleration_m_s2: float) -> float:
    """Acceleration in millionths of standard gravity."""
    return 1e6 * acceleration_m_s2 / STANDARD_GRAVITY_M_S2
