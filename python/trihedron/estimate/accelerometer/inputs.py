"""Checks of the arguments; errors name them in the user's words."""

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.errors import InputError


def pose_means(means: npt.ArrayLike, sigma_means: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Means (n, 3) and their covariances (n, 3, 3), from standard errors (), (3,), (n, 3) or covariances (n, 3, 3).

    Raises ``InputError`` when shapes do not fit, or something is not finite or not positive.
    """
    values = np.ascontiguousarray(means, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] != 3:
        raise InputError(f"mean readings must have shape (n, 3), got {values.shape}")
    n = len(values)
    if not np.all(np.isfinite(values)):
        pose = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
        raise InputError(f"the mean reading of pose {pose} is not finite: leave that pose out")
    sigma = np.asarray(sigma_means, dtype=np.float64)
    if sigma.shape in ((), (3,)):
        sigma = np.broadcast_to(sigma, (n, 3))
    if sigma.shape == (n, 3):
        if not np.all(np.isfinite(sigma)) or np.any(sigma < 0) or np.any(sigma.max(axis=1, initial=0.0) <= 0):
            raise InputError("standard errors of the means must be finite and positive (at least one axis per pose)")
        noise = np.zeros((n, 3, 3))
        noise[:, range(3), range(3)] = sigma**2
        return values, noise
    if sigma.shape != (n, 3, 3):
        raise InputError(f"noise of {n} means must have shape (3,), ({n}, 3) or ({n}, 3, 3), got {sigma.shape}")
    if not np.allclose(sigma, np.swapaxes(sigma, 1, 2)) or np.any(np.linalg.eigvalsh(sigma)[:, -1] <= 0):
        raise InputError("covariances of the means must be symmetric and positive")
    return values, np.ascontiguousarray(sigma)


def gravity(gravity_m_s2: float) -> float:
    """|g| in m/s².

    Raises ``InputError`` when it is not between 1 and 100 m/s²: its relative error would be that of every scale.
    """
    value = float(gravity_m_s2)
    if not 1.0 < value < 100.0:
        raise InputError(f"gravity must be given in m/s² (about 9.8 on Earth), got {value:g}")
    return value


def axis_signs(signs: npt.ArrayLike | None) -> FloatArray:
    """(3,) of ±1: sign of each raw axis against the body frame's axis; +1 where ``signs`` is ``None``.

    Raises ``InputError`` when ``signs`` is not three numbers ±1.
    """
    if signs is None:
        return np.ones(3)
    array = np.asarray(signs, dtype=np.float64)
    if array.shape != (3,) or not np.all(np.abs(array) == 1.0):
        raise InputError(f"axis signs must be three numbers +1 or -1, got {signs!r}")
    return array
