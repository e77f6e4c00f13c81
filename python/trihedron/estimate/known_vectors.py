"""Readings of known vectors (faces of a case, known turns) by least squares: ``raw = S_a v + b_a t + error``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import BoolArray, FloatArray

N_PARAMETERS = 12
STUCK = 1e-6
"""Least variance along any direction, as a share of the total: an axis without noise stays finite."""
UNDETERMINED = 1e-6
"""Share of a row's own variance left in its residual below which the other rows do not predict it."""


@dataclass(frozen=True, eq=False)
class KnownVectors:
    """``raw`` (n, 3) readings of the ``vectors`` (n, 3), in which the bias counts ``times`` (n,); noise and errors.

    ``noise`` (n, 3, 3) is the covariance of each row alone, ``shared`` (n, 3, m) the change of the rows by one standard
    deviation of each of m independent errors that rows share.
    """

    raw: FloatArray
    vectors: FloatArray
    times: FloatArray
    noise: FloatArray
    shared: FloatArray

    def of(self, used: BoolArray) -> KnownVectors:
        """The rows ``used`` (n,)."""
        return KnownVectors(*(of_rows[used] for of_rows in vars(self).values()))

    def residual(self, S_a: FloatArray, b_a: FloatArray) -> FloatArray:
        """(n, 3) measured minus predicted rows."""
        return self.raw - self.vectors @ S_a.T - np.outer(self.times, b_a)


@dataclass(frozen=True, eq=False)
class KnownFit:
    """Inverse form ``S_a``, ``b_a`` with its ``covariance`` (12, 12), χ² and degrees of freedom.

    ``log_likelihood`` is the restricted one, up to a constant; ``design`` (n, 3, 12 + m) and ``residual`` (n, 3) are
    whitened by ``roots`` (n, 3, 3) of the noise, ``joint`` the covariance with that of the m shared errors.
    """

    S_a: FloatArray
    b_a: FloatArray
    covariance: FloatArray
    chi2: float
    dof: int
    log_likelihood: float
    design: FloatArray
    residual: FloatArray
    roots: FloatArray
    joint: FloatArray

    def singular_values(self) -> FloatArray:
        """Singular values of the whitened design, its columns scaled to one."""
        columns = self.design[:, :, :N_PARAMETERS].reshape(-1, N_PARAMETERS)
        return np.asarray(np.linalg.svd(columns / np.linalg.norm(columns, axis=0), compute_uv=False))

    def gain(self) -> FloatArray:
        """(n, 12, 3) derivative of S_a row by row, then b_a, by each raw row."""
        to_parameters = self.joint[:N_PARAMETERS] @ np.swapaxes(self.design, 1, 2)
        return np.asarray(to_parameters @ np.linalg.inv(self.roots))

    def left_out(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Raw residual (n, 3) of each row predicted by all others, its covariance (n, 3, 3), and its χ² (n,).

        Closed form: ``(1 - H)⁻¹ r`` with H the row's block of the projection on the columns. NaN where the others do
        not determine the prediction.
        """
        kept = np.eye(3) - self.design @ self.joint @ np.swapaxes(self.design, 1, 2)
        is_told = np.linalg.eigvalsh(kept)[:, 0] > UNDETERMINED
        inverse = np.full(kept.shape, np.nan)
        inverse[is_told] = np.linalg.inv(kept[is_told])
        white = np.einsum("nij,nj->ni", inverse, self.residual)
        covariance = self.roots @ inverse @ np.swapaxes(self.roots, 1, 2)
        return np.einsum("nij,nj->ni", self.roots, white), covariance, np.einsum("ni,ni->n", self.residual, white)


def fit_known(rows: KnownVectors) -> KnownFit:
    """Weighted least squares of S_a, b_a and of the shared errors, whose prior is a standard normal each."""
    variance, axes = np.linalg.eigh(rows.noise)
    sigma = np.sqrt(np.maximum(variance, STUCK * variance.sum(axis=1, keepdims=True)))
    to_white = np.swapaxes(axes, 1, 2) / sigma[:, :, None]
    design = to_white @ np.concatenate([_by_parameters(rows), rows.shared], axis=2)
    side = np.einsum("nij,nj->ni", to_white, rows.raw)
    n_shared = rows.shared.shape[2]
    prior = np.eye(n_shared, N_PARAMETERS + n_shared, N_PARAMETERS)
    matrix = np.concatenate([design.reshape(-1, N_PARAMETERS + n_shared), prior])
    size = np.linalg.norm(matrix, axis=0)
    q, r = np.linalg.qr(matrix / size)
    inverse = np.linalg.inv(r) / size[:, None]
    solution = inverse @ (q[: side.size].T @ side.ravel())
    joint, residual = inverse @ inverse.T, side - design @ solution
    chi2 = float(np.sum(residual**2) + np.sum(solution[N_PARAMETERS:] ** 2))
    log_size = np.sum(np.log(sigma)) + np.sum(np.log(np.abs(np.diag(r)) * size))
    return KnownFit(
        S_a=solution[:9].reshape(3, 3),
        b_a=solution[9:N_PARAMETERS],
        covariance=joint[:N_PARAMETERS, :N_PARAMETERS],
        chi2=chi2,
        dof=side.size - N_PARAMETERS,
        log_likelihood=float(-log_size - 0.5 * chi2),
        design=design,
        residual=residual,
        roots=axes * sigma[:, None, :],
        joint=joint,
    )


def _by_parameters(rows: KnownVectors) -> FloatArray:
    """(n, 3, 12) derivative of the rows by S_a row by row, then b_a."""
    out = np.zeros((len(rows.raw), 3, N_PARAMETERS))
    for i in range(3):
        out[:, i, 3 * i : 3 * i + 3] = rows.vectors
        out[:, i, 9 + i] = rows.times
    return out
