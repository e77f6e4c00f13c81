"""Reference attitudes: from the angles of a dividing head to the specific force in the body (docs/kalman.md, eq. 1)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from trihedron.records.kalman import PoseTable

FloatArray = npt.NDArray[np.float64]


def _dividing_head() -> FloatArray:
    roll, pitch = np.meshgrid(np.arange(0.0, 81.0, 10.0), np.arange(0.0, 351.0, 10.0), indexing="ij")
    angles: FloatArray = np.column_stack([pitch.ravel(), roll.ravel()])
    angles.setflags(write=False)
    return angles


DIVIDING_HEAD_POSES: FloatArray = _dividing_head()
"""(324, 2) pitch and roll [deg] of the article: a full circle of pitch by 10° at each roll of 0, 10 … 80°."""


def pose_table_from_angles(
    pitch_deg: npt.ArrayLike,
    roll_deg: npt.ArrayLike = 0.0,
    *,
    gravity_m_s2: float,
    sigma_angle_deg: float = 0.0,
    source: str = "memory",
) -> PoseTable:
    """Specific force in the body for known pitch and roll.

    The body's z axis points up at zero angles; pitch θ turns about y, then roll φ about the new x:
    ``f = g (−sin θ, cos θ sin φ, cos θ cos φ)``. A head with one axis gives one angle and zero for the other.

    Parameters
    ----------
    pitch_deg, roll_deg : (n,) or scalar
        Angles, degrees.
    gravity_m_s2 : float
        Local gravity.
    sigma_angle_deg : float
        Standard error of an angle setting, which makes the reference uncertain by ``g σ``.

    Raises
    ------
    ValueError
        When the angles do not form one list of finite numbers.
    """
    try:
        theta, phi = np.broadcast_arrays(
            np.radians(np.asarray(pitch_deg, dtype=np.float64)), np.radians(np.asarray(roll_deg, dtype=np.float64))
        )
    except ValueError:
        raise ValueError(
            f"pitch and roll must have one entry per pose each, got {np.size(pitch_deg)} and {np.size(roll_deg)}"
        ) from None
    theta, phi = np.atleast_1d(theta), np.atleast_1d(phi)
    if not (np.isfinite(gravity_m_s2) and gravity_m_s2 > 0):
        raise ValueError(f"gravity must be positive, got {gravity_m_s2} m/s²")
    f = gravity_m_s2 * np.column_stack([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
    return PoseTable(f, sigma_m_s2=gravity_m_s2 * float(np.radians(sigma_angle_deg)), source=source)
