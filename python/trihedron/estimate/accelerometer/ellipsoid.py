"""The ellipsoid of readings in static poses, without an initial guess (docs/model.md, section 4)."""

from __future__ import annotations

from typing import Literal

import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.estimate.accelerometer import inputs


def ellipsoid(
    means: npt.ArrayLike, gravity_m_s2: float, frame: Literal["lower", "symmetric"] = "lower"
) -> tuple[FloatArray, FloatArray]:
    """S and b of the ellipsoid through the readings (eq. 18, 19): every pose weighs alike, no uncertainty.

    ``trihedron.calibrate`` starts from it and goes on to the least squares of ``|S a' + b| - |g|``, weighted by the
    noise of every pose.

    Parameters
    ----------
    means : (n, 3)
        Mean raw reading of every pose, n >= 9 (``Segments.accelerometer_mean``).
    gravity_m_s2 : float
        |g| [m/s²].
    frame : "lower" or "symmetric"
        Which S of those that a rotation turns into one another: lower-triangular (X along accelerometer X), or the
        symmetric root.

    Returns
    -------
    S : (3, 3)
        m/s² per raw unit.
    b : (3,)
        m/s².

    Raises
    ------
    ValueError
        Too few poses, or poses that lie on no ellipsoid; the sentence names the directions that are missing.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(1)
    >>> poses = rng.standard_normal((12, 3))
    >>> poses *= 9.81 / np.linalg.norm(poses, axis=1, keepdims=True)
    >>> S, b = ellipsoid((poses - [0.3, -0.2, 0.5]) / 0.01, 9.81)
    >>> S.round(6).diagonal().tolist(), b.round(6).tolist()
    ([0.01, 0.01, 0.01], [0.3, -0.2, 0.5])
    """
    return _core.fit_ellipsoid(inputs.pose_means(means, 1.0)[0], inputs.gravity(gravity_m_s2), frame == "symmetric")
