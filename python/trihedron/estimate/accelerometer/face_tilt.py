"""Effect on the faces' readings of a table that is not level, or a case that does not lie flat (docs/model.md, 2)."""

from __future__ import annotations

import numpy as np

from trihedron import probability
from trihedron.arrays import FloatArray, IntArray
from trihedron.estimate.accelerometer import face_poses

FREE_HEADINGS = 3
"""Number of headings that stay free when faces on one tilted table do not contradict each other at all: the heading of
each opposite face is such that its tilt cancels."""


def tilted(noise: FloatArray, faces: IntArray, S_a: FloatArray, g: float, tilt_rad: float | FloatArray) -> FloatArray:
    """Covariances (n, 3, 3) of raw means plus a horizontal error of ``g tilt`` rms per component (eq. 9).

    ``tilt_rad`` [rad] is a number or (n,).
    """
    unit = face_poses.direction_of(faces)
    horizontal = np.eye(3) - unit[:, :, None] * unit[:, None, :]
    size2 = np.broadcast_to((g * np.asarray(tilt_rad)) ** 2, len(noise))
    out: FloatArray = noise + size2[:, None, None] * np.einsum("ij,njk,lk->nil", S_a, horizontal, S_a)
    return out


def widened(dof: int, n_placements: int) -> float:
    """Factor on standard uncertainties from a tilt with few degrees of freedom, so that 1.96 of them cover 95 %.

    Where the tilts of placements are independent, their contradictions have ``dof`` degrees of freedom. One tilted
    table with the case at arbitrary headings is harder to detect: equal tilts cancel at some headings. The probability
    that the contradictions are below a fraction s of the tilt falls only as s^(n - 3).
    """
    free = max(min(dof, n_placements - FREE_HEADINGS), 1)
    return float(probability.stdtrit(free, 0.025) / probability.ndtri(0.025))
