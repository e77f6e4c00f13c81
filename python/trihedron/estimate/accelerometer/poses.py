"""Which parameters poses in given directions determine, in words, and which pose to add next.

In the lower-triangular body frame a small error of the model is ``δf = M f + z`` with M lower-triangular; in a pose
with specific force along the unit vector u the norm error is ``uᵀδf = g Σ_{j≥k} M_jk u_j u_k + zᵀu``. These nine
functions depend only on u, so that a set of poses can be assessed before a sample is recorded.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.records.calibration import Observability
from trihedron.records.words import Words, words
from trihedron.transforms import directions_of

ENTRIES = ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2))
"""Row and column of each of the six entries of M."""

RANK_TOLERANCE = 1e-6
"""Singular value, relative to the largest, below which a combination of parameters is undetermined: only repeated
readings of one pose agree to 1 ppm."""
DIRECTION_NOISE = 2.0
"""Singular value, in standard errors of all poses together, that errors of their directions alone produce: |g| and both
directions across have the same σ, and the derivative of a square is 2."""


@cache
def parameter_names() -> tuple[Words, ...]:
    """Names of the nine parameters in the user's words: scales and angles in the order of ``ENTRIES``, then biases."""
    entries = [
        words("scale-of-axis", axis=j + 1) if j == k else words("angle-between-axes", one=k + 1, other=j + 1)
        for j, k in ENTRIES
    ]
    return (*entries, *(words("bias-of-axis", axis=j + 1) for j in range(3)))


CANDIDATES: FloatArray = directions_of(np.array([c for c in product((-1.0, 0.0, 1.0), repeat=3) if any(c)]))
"""(26, 3) upward unit vectors: faces, edges and corners of a cube, the poses that are easy to set by hand."""


def design_rows(directions: FloatArray) -> FloatArray:
    """(n, 9) derivative of |f|/|g| with respect to (M, z/|g|) in poses with upward unit vectors (n, 3)."""
    u = np.asarray(directions, dtype=np.float64)
    return np.column_stack([u[:, j] * u[:, k] for j, k in ENTRIES] + [u[:, j] for j in range(3)])


def wrt_relative_errors(S: FloatArray, b: FloatArray, gravity_m_s2: float) -> FloatArray:
    """(12, 9) derivative of S, row by row, and b with respect to (M, z/|g|): δf = M f + z, δS = M S, δb = M b + z."""
    out = np.zeros((12, 9))
    for i, (j, k) in enumerate(ENTRIES):
        out[3 * j : 3 * j + 3, i] = S[k]
        out[9 + j, i] = b[k]
    out[9:, 6:] = gravity_m_s2 * np.eye(3)
    return out


def pose_in_words(direction: FloatArray) -> Words:
    """Orientation of the sensor, in words, in which a unit vector (3,) of the body frame points up.

    Examples
    --------
    >>> pose_in_words(np.array([0.7071, 0.0, -0.7071]))
    '+X/-Z edge up'
    """
    u = np.asarray(direction, dtype=np.float64)
    order = np.argsort(-np.abs(u), kind="stable")
    first = order[0]
    face = {"axis": first + 1, "is_up": u[first] > 0}
    others = [j for j in order[1:] if abs(u[j]) > 0.2]
    if not others:
        return words("face", **face)
    towards = [(j + 1, "+" if u[j] > 0 else "-") for j in others]
    return words("pose", **face, towards=towards, is_edge=len(others) == 1)


@dataclass(frozen=True, eq=False)
class PoseDesign:
    """Fisher information of a set of poses about the nine parameters, relative to |g|.

    ``rows`` (n, 9) are whitened; ``covariance`` is the inverse of ``information`` over ``rank`` determined directions;
    ``singular_values`` (9,) and ``directions`` (9, 9) are the SVD of ``rows`` divided by the column norms ``scale``.
    """

    rows: FloatArray
    information: FloatArray
    covariance: FloatArray
    rank: int
    singular_values: FloatArray
    scale: FloatArray
    directions: FloatArray

    @classmethod
    def of(cls, up: FloatArray, relative_sigma: FloatArray) -> PoseDesign:
        """Design of poses with upward unit vectors (n, 3) and standard errors σ/|g| (n,)."""
        rows = design_rows(up) / np.asarray(relative_sigma)[:, None]
        scale = np.linalg.norm(rows, axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        padded = np.zeros((max(len(rows), 9), 9))
        padded[: len(rows)] = rows / scale
        _, s, vt = np.linalg.svd(padded, full_matrices=False)
        noise = DIRECTION_NOISE * np.sqrt(len(rows)) * np.linalg.norm(vt / scale, axis=1)
        rank = int(np.sum(s > np.maximum(RANK_TOLERANCE * s[0], noise)))
        half = (vt[:rank].T / s[:rank]) / scale[:, None]
        return cls(rows, rows.T @ rows, half @ half.T, rank, s, scale, vt)

    def weakest(self) -> Words:
        """The least determined combination of parameters, in words."""
        direction = self.directions[-1] / self.scale
        share = np.abs(direction) / np.abs(direction).max()
        # Scale and bias are comparable: both are relative to |g|.
        names = [parameter_names()[k] for k in np.argsort(-share, kind="stable") if share[k] > 0.5]
        if self.rank < 9:
            return words("poses-unseen", names=names, rank=self.rank)
        return words("poses-weakest", names=names, times=self.singular_values[0] / self.singular_values[-1])

    def worst_prediction(self) -> float:
        """Largest standard uncertainty, in |g|, of the predicted norm over the candidate directions."""
        if self.rank < 9:
            return float("inf")
        rows = design_rows(CANDIDATES)
        return float(np.sqrt(np.einsum("ij,jk,ik->i", rows, self.covariance, rows).max()))

    def advice(self, relative_sigma: float, n_poses: int) -> tuple[Words, ...]:
        """The poses to add, one after another: those that add most information while parameters are undetermined, then
        those that most reduce the largest variance."""
        information = self.information.copy()
        # A prior of one (100 % of scale, |g| of bias) makes undetermined and weakly determined parameters comparable.
        information += np.eye(9)
        rows = design_rows(CANDIDATES) / relative_sigma
        advised = []
        for k in range(n_poses):
            covariance = np.linalg.inv(information)
            seen = rows @ covariance
            of_rows = np.einsum("ij,ij->i", seen, rows)
            left = np.diag(covariance) - seen**2 / (1.0 + of_rows)[:, None]
            # The largest variance decides; the sum breaks ties, so that a pose also helps the second largest.
            largest = left.max(axis=1) + 1e-3 * left.sum(axis=1)
            best = int(np.argmax(of_rows) if self.rank + k < 9 else np.argmin(largest))
            advised.append(pose_in_words(CANDIDATES[best]))
            information += np.outer(rows[best], rows[best])
        return tuple(advised)

    def observability(self, relative_sigma: float, n_advised: int = 3) -> Observability:
        """The design as an ``Observability`` record, with at least ``n_advised`` poses to add."""
        missing = max(9 - self.rank, 0)
        n_advised = max(missing, n_advised)
        return Observability(
            rank=self.rank,
            n_parameters=9,
            condition=float(self.singular_values[0] / self.singular_values[-1]) if self.rank == 9 else float("inf"),
            singular_values=self.singular_values,
            weakest=self.weakest(),
            advice=self.advice(relative_sigma, n_advised),
        )
