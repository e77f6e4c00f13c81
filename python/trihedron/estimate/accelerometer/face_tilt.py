"""What a table that is not level, or a case that does not lie flat, does to the faces' readings (docs/model.md, 2)."""

from __future__ import annotations

import numpy as np

from trihedron import probability
from trihedron.arrays import FloatArray, IntArray
from trihedron.estimate.accelerometer import face_poses

FREE_HEADINGS = 3
"""Headings that remain free where faces on one leaning table do not contradict each other at all: each opposite face
turned so as to lean the other way."""


def tilted(noise: FloatArray, faces: IntArray, S_a: FloatArray, g: float, tilt_rad: float | FloatArray) -> FloatArray:
    """Covariances (n, 3, 3) of raw means with a horizontal error of ``g tilt`` rms per component on top (eq. 9).

    ``tilt_rad`` is one number or (n,).
    """
    unit = face_poses.direction_of(faces)
    horizontal = np.eye(3) - unit[:, :, None] * unit[:, None, :]
    size2 = np.broadcast_to((g * np.asarray(tilt_rad)) ** 2, len(noise))
    out: FloatArray = noise + size2[:, None, None] * np.einsum("ij,njk,lk->nil", S_a, horizontal, S_a)
    return out


def widened(dof: int, n_placements: int) -> float:
    """Factor on standard errors of a tilt that is known from few contradictions: 1.96 of them shall hold in 95 %.

    Where every placement leans by itself the contradictions have ``dof`` degrees of freedom. One table that leans, with
    the case put on it at any heading, hides its tilt more easily: leans of one size cancel where headings happen to
    fit. The share of headings whose contradictions stay below a part s of the tilt falls as s^(n - 3) only.
    """
    free = max(min(dof, n_placements - FREE_HEADINGS), 1)
    return float(probability.stdtrit(free, 0.025) / probability.ndtri(0.025))
