"""Gravity and rotation of the Earth where the sensor stands."""

import math

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError

EARTH_RATE_RAD_S = 7.292115e-5
"""Rotation of the Earth against inertial space (WGS 84)."""

_EQUATORIAL_RADIUS_M = 6378137.0
_FLATTENING = 1.0 / 298.257223563
_GM_M3_S2 = 3.986004418e14
_GRAVITY_EQUATOR_M_S2 = 9.7803253359
_GRAVITY_POLE_M_S2 = 9.8321849378
_POLAR_RADIUS_M = _EQUATORIAL_RADIUS_M * (1.0 - _FLATTENING)
_ECCENTRICITY2 = _FLATTENING * (2.0 - _FLATTENING)


def normal_gravity(latitude_deg: float, height_m: float = 0.0) -> float:
    """Magnitude of normal gravity [m/s²] at a geodetic latitude [deg] and height above the ellipsoid [m].

    Somigliana's closed formula on the WGS 84 ellipsoid and the second-order height correction (NIMA TR8350.2, eq. 4-1
    and 4-3). The local anomaly is not included: typically 3e-4 m/s², seldom above 2e-3 m/s², which is 0.02 % of scale.

    Raises
    ------
    ValueError
        When the latitude is not within ±90° or the height not within -1 to 20 km.

    Examples
    --------
    >>> round(normal_gravity(45.0), 6)
    9.806198
    """
    if not -90.0 <= latitude_deg <= 90.0:
        raise InputError(f"latitude must be between -90 and 90 degrees, got {latitude_deg}")
    if not -1000.0 <= height_m <= 20000.0:
        raise InputError(f"height must be between -1000 and 20000 m, got {height_m}")
    sin2 = math.sin(math.radians(latitude_deg)) ** 2
    k = _POLAR_RADIUS_M * _GRAVITY_POLE_M_S2 / (_EQUATORIAL_RADIUS_M * _GRAVITY_EQUATOR_M_S2) - 1.0
    at_surface = _GRAVITY_EQUATOR_M_S2 * (1.0 + k * sin2) / math.sqrt(1.0 - _ECCENTRICITY2 * sin2)
    m = EARTH_RATE_RAD_S**2 * _EQUATORIAL_RADIUS_M**2 * _POLAR_RADIUS_M / _GM_M3_S2
    relative = height_m / _EQUATORIAL_RADIUS_M
    return at_surface * (1.0 - 2.0 * (1.0 + _FLATTENING + m - 2.0 * _FLATTENING * sin2) * relative + 3.0 * relative**2)


LEAST_M_S2, MOST_M_S2 = normal_gravity(0.0, 20000.0), normal_gravity(90.0, -1000.0)
"""Gravity of all places that latitude and height can state: another value is in another unit, or a slip."""


def earth_rate_up(latitude_deg: float | None) -> float:
    """Upward component [rad/s] of the Earth's rotation at a latitude [deg]; 0 where none is stated."""
    return 0.0 if latitude_deg is None else earth_rate_north_up(latitude_deg)[1]


def unknown_earth_rate(latitude_deg: float | None) -> tuple[float, float]:
    """Standard deviations [rad/s] of what is not known of the Earth's rotation in a body of any heading: across the
    vertical and along it, at a latitude [deg]; at any place where none is stated."""
    if latitude_deg is None:
        return EARTH_RATE_RAD_S / math.sqrt(3.0), EARTH_RATE_RAD_S / math.sqrt(3.0)
    return earth_rate_north_up(latitude_deg)[0] / math.sqrt(2.0), 0.0


def earth_rate_north_up(latitude_deg: float) -> tuple[float, float]:
    """Northward and upward components [rad/s] of the Earth's rotation at a latitude [deg]."""
    latitude = math.radians(latitude_deg)
    return EARTH_RATE_RAD_S * math.cos(latitude), EARTH_RATE_RAD_S * math.sin(latitude)


def turned_with_earth(latitude_deg: float | None, up: FloatArray) -> FloatArray:
    """Covariances (n, 3, 3) [rad²/s²] of what is not known of the Earth's rotation in poses of unknown heading with
    directions ``up`` (n, 3)."""
    across, along = np.square(unknown_earth_rate(latitude_deg))
    return np.asarray(across * np.eye(3) + (along - across) * up[:, :, None] * up[:, None, :])
