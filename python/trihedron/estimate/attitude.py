"""Attitude by integration of an angular rate."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.errors import InputError

Form = Literal["matrices", "quaternions", "vectors"]
"""Representation of an attitude."""
RateShape = Literal["constant", "linear", "coning"]
"""Interpolation of the rate between two samples."""

_FORMS: dict[str, int] = {"matrices": 0, "quaternions": 1, "vectors": 2}
_DEGREES: dict[str, int] = {"constant": 0, "linear": 1, "coning": 3}
_ORTHOGONAL = 1e-6
"""Tolerance of RᵀR - 1 for a rotation and of |q| - 1 for a quaternion: six printed digits pass, a scale error fails."""


def integrate_rate(
    time_s: npt.ArrayLike,
    rate: npt.ArrayLike,
    *,
    form: Form = "matrices",
    between: RateShape = "linear",
    start: npt.ArrayLike | None = None,
    last_only: bool = False,
) -> FloatArray:
    """Attitude at every sample of a corrected angular rate, by exact rotations: ``R' = R [ω]×``.

    Parameters
    ----------
    time_s : (n,)
        Timestamps [s], ascending, at any spacing; between equal timestamps the rotation is zero.
    rate : (n, 3)
        Angular rate [rad/s] along the axes of the body, bias and scale corrected (:func:`trihedron.apply`).
    form : "matrices", "quaternions" or "vectors"
        ``(n, 3, 3)``; ``(n, 4)`` as x y z w, the order of SciPy, without jumps of sign; or rotation vectors ``(n, 3)``
        [rad], of length up to π.
    between : "linear", "constant" or "coning"
        The rate is a straight line from sample to sample (second order, with the coning of that line), each sample
        until the next (first order), or a cubic through four samples (fourth order, with the coning inside an interval;
        several times slower).
    start : matrix (3, 3), quaternion (4,) or rotation vector (3,), optional
        Attitude at the first sample; the identity otherwise.
    last_only : bool
        Only the last attitude, ``(3, 3)``, ``(4,)`` or ``(3,)``: twice as fast, without an array of n attitudes.

    Returns
    -------
    FloatArray
        ``R[k]`` takes a vector from the body frame at sample k to that of the start: ``v = R[k] @ v_body``. The ``B``
        of the documentation (start to body) is its transpose.

    Raises
    ------
    ValueError
        When shapes do not fit, a sample is not finite or time runs backward (naming the sample), or ``start`` is no
        attitude.

    Notes
    -----
    Equation (5.3) of ``docs/model-gyroscope.md``. Rounding adds some 1e-13 rad over a million steps. The accuracy is
    limited by the gyro bias: its error times the time is the attitude error.

    Examples
    --------
    >>> import numpy as np, trihedron
    >>> t = np.linspace(0.0, 2.0, 201)
    >>> rate = np.tile([0.0, 0.0, np.pi / 4], (201, 1))
    >>> trihedron.integrate_rate(t, rate, form="vectors")[-1].round(6).tolist()
    [0.0, 0.0, 1.570796]
    """
    t = np.asarray(time_s, dtype=np.float64)
    w = np.asarray(rate, dtype=np.float64)
    if t.ndim != 1 or w.shape != (len(t), 3) or len(t) == 0:
        raise InputError(f"time_s must have shape (n,) and rate (n, 3), n at least 1; got {t.shape} and {w.shape}")
    if form not in _FORMS:
        raise InputError(f"form must be one of {', '.join(_FORMS)}, got {form!r}")
    if between not in _DEGREES:
        raise InputError(f"between must be one of {', '.join(_DEGREES)}, got {between!r}")
    initial = None if start is None else _quaternion(np.asarray(start, dtype=np.float64))
    return _core.integrate_rate(t, w, _DEGREES[between], _FORMS[form], last_only, initial)


def _quaternion(start: FloatArray) -> FloatArray:
    """Unit quaternion (4,) x y z w of an attitude: rotation matrix (3, 3), rotation vector (3,) or quaternion (4,)."""
    if start.shape == (3, 3):
        if not np.abs(start.T @ start - np.eye(3)).max() < _ORTHOGONAL or np.linalg.det(start) < 0.0:
            raise InputError("the start is no attitude: its columns are not orthogonal unit vectors of a right hand")
        start = _core.vector_from_rotation(start[np.newaxis])[0]
    if start.shape == (3,):
        if not np.isfinite(start).all():
            raise InputError("the start is no attitude: its rotation vector is not finite")
        angle = float(np.linalg.norm(start))
        # np.sinc(x) is sin(πx)/(πx).
        return np.append(0.5 * np.sinc(0.5 * angle / np.pi) * start, np.cos(0.5 * angle))
    if start.shape == (4,) and abs(float(np.linalg.norm(start)) - 1.0) < _ORTHOGONAL:
        return start / np.linalg.norm(start)
    raise InputError(
        "the start must be a rotation matrix (3, 3), a unit quaternion x y z w (4,) or a rotation vector (3,), "
        f"got shape {start.shape}"
    )
