"""The axes of a case, shown by gravity on its faces and by turns on them (docs/model.md, section 2).

A pose on a face has no force across it, a turn on a face no rotation across it, but for leans: of the table, which
turns with the case and is common to the poses of one placement, and of the face, which its poses and turns share.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.estimate.accelerometer.face_poses import FACES, direction_of
from trihedron.estimate.accelerometer.verdict import SIGNIFICANCE
from trihedron.probability import chdtri
from trihedron.transforms import rotation_by

FLAT_RAD, FLAT_DOF = math.radians(0.1), 0.5
"""Prior of a face's lean, one component: at most 0.09 mm over 50 mm (turned and moulded cases: 0.02 to 0.1°), and the
degrees of freedom of that size: poses and turns that show a flatter face halve it. What differs from turn to turn has
the same prior."""
LEAN_RAD = math.radians(1.0)
"""Lean of a table with which the search for its size begins."""
ROUNDS, SETTLED = 500, 1e-3
"""Most steps of that search (expectation maximisation), and the relative change of all sizes at which it ends."""
LEAST_RAD = 1e-7
"""Least error of a component: logs of simulations without noise, and errors that all readings of an axis share."""
TABLE, HEADING, TURN = "table", "heading", "turn"
"""Names of the leans of a table, of what differs from heading to heading on it and from turn to turn; those of faces
have their number."""
OF_TABLE = (TABLE, HEADING)
"""Leans of any size; others have the prior of faces."""


@dataclass(frozen=True, eq=False)
class CaseRows:
    """Components along axes of the case, in rad: ``slope`` (n, p) times the parameters is ``side`` (n,) and errors.

    ``noise`` (n, n) is the covariance of errors of known size; ``leans`` are columns (n, k) by leans, by name.
    """

    slope: FloatArray
    side: FloatArray
    noise: FloatArray
    leans: dict[str, FloatArray]

    def beside(self, other: CaseRows) -> CaseRows:
        """These rows and then those of ``other``."""
        n, m = len(self.side), len(other.side)
        noise = np.zeros((n + m, n + m))
        noise[:n, :n], noise[n:, n:] = self.noise, other.noise
        width = {name: of.shape[1] for name, of in (self.leans | other.leans).items()}
        leans = {
            name: np.concatenate([self.leans.get(name, np.zeros((n, k))), other.leans.get(name, np.zeros((m, k)))])
            for name, k in width.items()
        }
        slope, side = np.concatenate([self.slope, other.slope]), np.append(self.side, other.side)
        return CaseRows(slope, side, noise, leans)


@dataclass(frozen=True, eq=False)
class CaseFit:
    """Parameters ``values`` (p,) with their ``covariance``, the ``free`` directions' ``steps`` (k,), χ² and its degrees
    of freedom, sizes [rad] of leans by name, and the projection (n, n) that makes residuals of ``misfit`` (n,)."""

    values: FloatArray
    covariance: FloatArray
    steps: FloatArray
    chi2: float
    dof: int
    sizes: dict[str, float]
    projection: FloatArray
    misfit: FloatArray

    def left_out(self, blocks: IntArray) -> tuple[FloatArray, FloatArray]:
        """Errors (b, q) of blocks of rows (b, q) predicted by all others, and their covariances (b, q, q); NaN where
        the others do not determine them."""
        of_blocks = self.projection[blocks[:, :, None], blocks[:, None, :]]
        whole = np.linalg.eigvalsh(of_blocks)
        covariance = np.full(of_blocks.shape, np.nan)
        is_told = whole[:, 0] > 1e-9 * whole[:, -1]
        covariance[is_told] = np.linalg.inv(of_blocks[is_told])
        return np.einsum("bij,bj->bi", covariance, (self.projection @ self.misfit)[blocks]), covariance


def fit_case(
    values: FloatArray, covariance: FloatArray, free: FloatArray, poses: CaseRows, turns: CaseRows | None = None
) -> CaseFit:
    """Parameters ``values`` (p,) with their ``covariance``, updated with rows; directions ``free`` (p, k) are unknown.

    Poses that contradict each other beyond their noise and the lean of faces were on a table that leans; the sizes of
    leans are those of the largest restricted likelihood with their priors.
    """
    known = {name: FLAT_RAD for name in poses.leans if name not in OF_TABLE}
    level = solved(values, covariance, free, poses, known)
    is_level = level.dof <= 0 or level.chi2 <= chdtri(level.dof, SIGNIFICANCE)
    rows = poses if turns is None else poses.beside(turns)
    of_table = {} if is_level else {name: LEAN_RAD for name in rows.leans if name in OF_TABLE}
    sizes = {name: FLAT_RAD for name in rows.leans if name not in OF_TABLE} | of_table
    fit = solved(values, covariance, free, rows, sizes)
    for _ in range(ROUNDS if sizes else 0):
        last, sizes = sizes, {name: _size(fit, rows.leans[name], name) for name in sizes}
        fit = solved(values, covariance, free, rows, sizes)
        if all(abs(sizes[name] / last[name] - 1.0) < SETTLED for name in sizes):
            break
    return replace(fit, chi2=level.chi2, dof=level.dof)


def _size(fit: CaseFit, columns: FloatArray, name: str) -> float:
    """Size of leans after one step of expectation maximisation, from their posterior mean squares."""
    before, dof = fit.sizes[name] ** 2, 0.0 if name in OF_TABLE else FLAT_DOF
    through = columns.T @ fit.projection
    squares = np.sum((before * through @ fit.misfit) ** 2) + before * columns.shape[1]
    squares -= before**2 * np.sum(through * columns.T)
    return math.sqrt((dof * FLAT_RAD**2 + float(squares)) / (dof + columns.shape[1]))


def solved(
    values: FloatArray, covariance: FloatArray, free: FloatArray, rows: CaseRows, sizes: dict[str, float]
) -> CaseFit:
    """Parameters ``values`` (p,) with their ``covariance``, updated with rows whose leans have these ``sizes``."""
    together = rows.slope @ covariance @ rows.slope.T + rows.noise
    for name, size in sizes.items():
        together += size**2 * rows.leans[name] @ rows.leans[name].T
    inverse, by_free = np.linalg.inv(together), rows.slope @ free
    of_free = np.linalg.inv(by_free.T @ inverse @ by_free)
    gain, unknown = covariance @ rows.slope.T @ inverse, inverse @ by_free
    projection = inverse - unknown @ of_free @ unknown.T
    misfit = rows.side - rows.slope @ values
    steps = of_free @ unknown.T @ misfit
    through = free - gain @ by_free
    posterior = covariance - gain @ rows.slope @ covariance + through @ of_free @ through.T
    return CaseFit(
        values=values + free @ steps + gain @ (misfit - by_free @ steps),
        covariance=0.5 * (posterior + posterior.T),
        steps=steps,
        chi2=float(misfit @ projection @ misfit),
        dof=len(misfit) - free.shape[1],
        sizes=sizes,
        projection=projection,
        misfit=misfit,
    )


@dataclass(frozen=True, eq=False)
class OnFaces:
    """Raw readings (n, 3) on ``faces`` (n,), the axis of the case that is up (±1, ±2, ±3), with covariances (n, 3, 3).

    Of poses they are means, of ``sizes`` (n,) of gravity, with ``times`` (n,) of one; of turns ∫ w' dt, of the angles
    [rad] about the axis that is up, with the times [s] in which the bias counts.
    """

    values: FloatArray
    noise: FloatArray
    faces: IntArray
    sizes: FloatArray
    times: FloatArray

    def rows(self, S: FloatArray, axes: IntArray, first: int, n_parameters: int) -> CaseRows:
        """Components along ``axes`` (n, q) of the case, 0 but along the axis that is up; noise by the scale ``S``
        (3, 3) so far. The sensor has the twelve parameters from ``first`` on."""
        n, q = axes.shape
        slope, noise = np.zeros((n, q, n_parameters)), np.zeros((n * q, n * q))
        for i, of_row in enumerate(axes):
            for j, axis in enumerate(of_row):
                slope[i, j, first + 3 * axis : first + 3 * axis + 3] = self.values[i] / self.sizes[i]
                slope[i, j, first + 9 + axis] = self.times[i] / self.sizes[i]
            block = slice(q * i, q * i + q)
            of_noise = (S[of_row] @ self.noise[i] @ S[of_row].T) / self.sizes[i] ** 2
            noise[block, block] = of_noise + LEAST_RAD**2 * np.eye(q)
        is_up = axes == (np.abs(self.faces) - 1)[:, None]
        side = np.where(is_up, np.sign(self.faces)[:, None], 0.0)
        return CaseRows(slope.reshape(n * q, -1), side.ravel(), noise, {})

    def face_leans(self) -> dict[str, FloatArray]:
        """Columns (2 n, 2) by the lean of each face, of the components across faces."""
        of = {face: (self.faces == face)[:, None, None] * np.eye(2) for face in FACES}
        return {str(face): columns.reshape(-1, 2) for face, columns in of.items()}


def across_faces(faces: IntArray) -> IntArray:
    """(n, 2) the axes of the case across faces (n,)."""
    return np.asarray((np.abs(faces)[:, None] + np.array([0, 1])) % 3, dtype=np.int64)


def at_headings(faces: IntArray, headings: FloatArray) -> FloatArray:
    """(n, 2, 2) matrices to components across faces (n,) at headings (n,) [rad] from those of the same vector of the
    room at heading 0."""
    turns = np.array([rotation_by(-angle * up) for angle, up in zip(headings, direction_of(faces), strict=True)])
    across, n = across_faces(faces), np.arange(len(faces))[:, None, None]
    return np.asarray(turns[n, across[:, :, None], across[:, None, :]])


def spread_over(columns: FloatArray, owner: IntArray) -> FloatArray:
    """Columns (q n, 2 k) of errors of their ``owner`` (n,) from those of its own, (n, q, 2)."""
    n, q, _ = columns.shape
    out = np.zeros((n, q, int(owner.max(initial=-1)) + 1, 2))
    out[np.arange(n), :, owner] = columns
    return out.reshape(n * q, -1)
