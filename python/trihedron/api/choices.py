"""Optional inputs of a calibration and their defaults: gravity."""

from __future__ import annotations

from trihedron.errors import InputError
from trihedron.gravity import LEAST_M_S2, MOST_M_S2, normal_gravity
from trihedron.records import Calibration, Finding
from trihedron.units import STANDARD_GRAVITY_M_S2


def settle_gravity(
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
    known: tuple[float, str] | None = None,
) -> tuple[float, str, tuple[Finding, ...]]:
    """|g| [m/s²], its source, and findings about it; where nothing is given ``known``, else the standard value.

    Raises ``InputError`` when two sources contradict each other, a height has no latitude, or a value is not
    plausible as gravity.
    """
    if gravity_m_s2 is not None:
        if latitude_deg is not None or height_m is not None:
            raise InputError("gravity is given twice, as a value and by a place: give either --gravity or --latitude.")
        if not LEAST_M_S2 <= gravity_m_s2 <= MOST_M_S2:
            raise InputError(
                f"gravity is given in m/s² whatever the unit of the log: on Earth {LEAST_M_S2:.2f} to {MOST_M_S2:.2f}, "
                f"and cannot be {gravity_m_s2:g}."
            )
        return float(gravity_m_s2), "given", ()
    if latitude_deg is not None:
        height = 0.0 if height_m is None else height_m
        value = normal_gravity(latitude_deg, height)
        return value, f"WGS 84 normal gravity at latitude {latitude_deg:g}°, height {height:g} m", ()
    if height_m is not None:
        raise InputError("a height alone does not determine gravity: give --latitude with --height, or --gravity.")
    if known is not None:
        return *known, ()
    low, high = normal_gravity(0.0, 3000.0), normal_gravity(90.0)
    wrong = 100.0 * max(STANDARD_GRAVITY_M_S2 - low, high - STANDARD_GRAVITY_M_S2) / STANDARD_GRAVITY_M_S2
    defaulted = Finding.of(
        "gravity-defaulted",
        gravity_m_s2=STANDARD_GRAVITY_M_S2,
        low_m_s2=low,
        high_m_s2=high,
        possible_error_percent=wrong,
    )
    return STANDARD_GRAVITY_M_S2, "not given, standard value", (defaulted,)


def gravity_of(calibration: Calibration | None) -> tuple[float, str] | None:
    """|g| [m/s²] of a calibration and the words for this source; ``None`` without one."""
    return None if calibration is None else (calibration.gravity_m_s2, "that of the calibration")
