"""A misfit and what columns would take out of it, in sample and on blocks left out (docs/relations.md, eq. L.1-L.4).

Everything is in terms of ``P = V⁻¹ − V⁻¹B(BᵀV⁻¹B)⁻¹BᵀV⁻¹``: V the noise with its slow part, B columns that the model
fits anyway. The residual of a block b that nothing of the fit has seen is ``P_bb⁻¹ (P y)_b``, with precision ``P_bb``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.special import fdtrc

from trihedron.arrays import FloatArray

N_BLOCKS = 6
"""Blocks of neighbouring poses or moves that are left out in turn."""
RIGID = 1e-8
"""Directions of a block that nothing outside it predicts: their precision is this small beside the largest."""
IMITATED = 1e-7
"""Smallest eigenvalue of columns of unit length: below it one is the others' sum to three digits."""
FEWEST_LEFT = 4.0
"""Degrees of freedom that must be left: with three the 1 % point of F is 34."""
TINY = float(np.finfo(float).tiny)
"""Keeps a ratio finite."""


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of a candidate as the misfit sees them: ``phi`` (n, k), ``projected`` P Φ (n, k), ``side`` ΦᵀPy (k,)."""

    phi: FloatArray
    projected: FloatArray
    side: FloatArray

    @property
    def normal(self) -> FloatArray:
        """(k, k) ΦᵀPΦ."""
        out: FloatArray = self.phi.T @ self.projected
        return 0.5 * (out + out.T)

    def beside(self, other: Columns) -> Columns:
        """Both together."""
        return Columns(
            np.hstack([self.phi, other.phi]),
            np.hstack([self.projected, other.projected]),
            np.concatenate([self.side, other.side]),
        )


@dataclass(frozen=True, eq=False)
class Judged:
    """A law's standing: ``chi2`` it takes over the dispersion that stays, ``rank``, ``p_value``, held-out ``gain`` in
    log-likelihood, ``share`` of the held-out sum of squares it removes, coefficients with covariance.
    """

    chi2: float
    rank: int
    p_value: float
    gain: float
    share: float
    value: FloatArray
    covariance: FloatArray
    squares: float
    """What is left of yᵀPy; ``held_before`` and ``held_after`` are held-out mean squares in the reading's unit."""
    held_before: float
    held_after: float


@dataclass(frozen=True, eq=False)
class _Block:
    """Rows left out together: their precision is one in the coordinates ``root`` (r, rows); ``along`` (r,) is the
    residual there that nothing of the fit has seen.
    """

    rows: npt.NDArray[np.intp]
    root: FloatArray
    along: FloatArray
    log_det: float


@dataclass(frozen=True, eq=False)
class Misfit:
    """``P`` (n, n) on the rows of a domain, ``Py`` (n,), ``square`` = yᵀPy, ``dof``, and the ``unit`` of every row.

    ``unit`` (n,) numbers the pose or move that a row belongs to, in the order of time; ``variance`` is that of a row in
    the reading's own unit, SI squared (1 where rows are whitened numbers of several units).
    """

    P: FloatArray
    Py: FloatArray
    square: float
    dof: float
    unit: npt.NDArray[np.intp]
    variance: float = 1.0

    def columns(self, phi: FloatArray) -> Columns:
        """Columns given as they add to the rows (n, k)."""
        return Columns(phi, self.P @ phi, phi.T @ self.Py)

    def judge(self, columns: Columns) -> Judged | None:
        """What the columns take out; ``None`` where the fit imitates them."""
        normal = columns.normal
        length = np.sqrt(np.maximum(np.diag(normal), 0.0))
        if not (length > 0.0).all():
            return None
        scaled = normal / np.outer(length, length)
        value, vector = np.linalg.eigh(scaled)
        if value[0] < IMITATED:
            return None
        inverse = (vector / value) @ vector.T / np.outer(length, length)
        estimate = inverse @ columns.side
        taken = float(columns.side @ estimate)
        k = len(estimate)
        left = max(self.square - taken, 1e-300)
        dof = self.dof - k
        if dof < FEWEST_LEFT:
            return None
        spread = left / dof
        p = float(fdtrc(k, dof, max(taken, 0.0) / k / spread))
        before = self.held_out
        after = self._held_out_with(columns.projected, estimate, (vector / np.sqrt(value)) / length[:, None])
        n = before[2]
        gain = 0.5 * n * np.log(before[0] / max(after[0], 1e-300)) + 0.5 * (before[1] - after[1])
        return Judged(
            taken / spread, k, max(p, 1e-300), float(gain), 1.0 - after[0] / before[0], estimate, inverse * spread,
            left, self.variance * before[0] / n, self.variance * after[0] / n,
        )  # fmt: skip

    @cached_property
    def held_out(self) -> tuple[float, float, float]:
        """Sum of squares, log-determinant and number of what blocks left out are predicted by the rest, no law."""
        total = sum(float(block.along @ block.along) for block in self._blocks)
        count = float(sum(len(block.along) for block in self._blocks))
        return max(total, 1e-300), sum(block.log_det for block in self._blocks), max(count, 1.0)

    @cached_property
    def _blocks(self) -> tuple[_Block, ...]:
        out = []
        for units in np.array_split(np.unique(self.unit), N_BLOCKS):
            rows = np.flatnonzero(np.isin(self.unit, units))
            if not len(rows):
                continue
            value, vector = np.linalg.eigh(self.P[np.ix_(rows, rows)])
            seen = value > RIGID * max(float(value[-1]), TINY)
            root = (vector[:, seen] / np.sqrt(value[seen])).T
            out.append(_Block(rows, root, root @ self.Py[rows], -float(np.log(value[seen]).sum())))
        return tuple(out)

    def _held_out_with(
        self, projected: FloatArray, estimate: FloatArray, half: FloatArray
    ) -> tuple[float, float, float]:
        """The same with columns beside: ``P − U C Uᵀ``, ``U`` = ``projected``, ``C`` = ``half halfᵀ``.

        In the coordinates in which a block of ``P`` is one, what is taken off has rank k: ``1 − G Gᵀ`` with
        ``G = root U half``. Its inverse and determinant follow from the k eigenvalues of ``GᵀG``; directions that it
        takes off whole are those that only the block itself tells.
        """
        root, known, first, log_det = self._all_blocks
        seen = root @ projected
        along = known - seen @ estimate
        G = seen @ half
        value, vector = np.linalg.eigh(np.add.reduceat(G[:, :, None] * G[:, None, :], first))
        stays = 1.0 - value
        is_open = stays > RIGID
        inside = np.einsum("bkj,bk->bj", vector, np.add.reduceat(G * along[:, None], first))
        total = float(along @ along) + float((inside[is_open] ** 2 / stays[is_open]).sum())
        count = float(len(along) - np.count_nonzero(~is_open))
        return max(total, 1e-300), log_det - float(np.log(stays[is_open]).sum()), max(count, 1.0)

    @cached_property
    def _all_blocks(self) -> tuple[FloatArray, FloatArray, npt.NDArray[np.intp], float]:
        """Roots of all blocks on all rows, what is along them, the first of every block, and the sum of logarithms."""
        blocks = [block for block in self._blocks if len(block.root)]
        first = np.cumsum([0, *(len(block.root) for block in blocks)])
        root = np.zeros((first[-1], len(self.Py)))
        for a, b, block in zip(first[:-1], first[1:], blocks, strict=True):
            root[a:b, block.rows] = block.root
        along = np.concatenate([np.zeros(0), *(block.along for block in blocks)])
        return root, along, first[:-1], sum(block.log_det for block in self._blocks)

    def squares_with(self, columns: Columns) -> float:
        """What is left of the square with these columns."""
        normal = columns.normal
        length = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        scaled = normal / np.outer(length, length) + 1e-9 * np.eye(len(length))
        side = columns.side / length
        return float(self.square - side @ np.linalg.solve(scaled, side))


def misfit_of(y: FloatArray, base: FloatArray, V: FloatArray, unit: npt.NDArray[np.intp]) -> Misfit:
    """The misfit of readings ``y`` (n,) with covariance ``V`` beside columns ``base`` (n, p) of the model."""
    inverse = np.linalg.inv(V)
    side = inverse @ base
    normal = base.T @ side
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    P = (
        inverse
        - side @ (np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-10) / np.outer(scale, scale)) @ side.T
    )
    rank = np.linalg.matrix_rank(base / np.maximum(np.linalg.norm(base, axis=0), 1e-300))
    return Misfit(P, P @ y, float(y @ P @ y), float(len(y) - rank), unit, float(np.mean(np.diag(V))))
