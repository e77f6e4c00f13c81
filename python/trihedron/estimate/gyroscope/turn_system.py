"""The linear system of method 1: ``φ'_i = S_w φ_i + b_w Δt_i + δφ_i`` weighted by noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.estimate.gyroscope.turn_angles import MeasuredTurns


@dataclass(frozen=True, eq=False)
class TurnSystem:
    """Turns with known ``angles`` (k, 3), rad; a rough ``S_w`` (3, 3) converts their errors in rad into raw units.

    ``sigma_turn`` [rad] is the standard error along a turn, ``sigma_tilt`` [rad] that across it (tilt of table, case).
    ``sigma_directions`` (k,) [rad] is the standard error of each turn's measured axis, per component across it.
    ``faces`` (k,) is the face (±1, ±2, ±3; 0 unknown) of each turn, ``sigma_face`` [rad] the standard deviation of the
    tilt of a face, one component, which all turns on that face share in either sense.
    """

    measured: MeasuredTurns
    angles: FloatArray
    S_w: FloatArray
    sigma_turn: float = 0.0
    sigma_tilt: float = 0.0
    sigma_directions: FloatArray | None = None
    faces: IntArray | None = None
    sigma_face: float = 0.0

    def covariances(self) -> FloatArray:
        """(k, 3, 3) covariance of each raw turn: rate noise ``N² Δt``, bias drift between poses, error of the turn."""
        axis = self.axes @ self.S_w.T
        along = (self.sigma_turn**2 - self.sigma_tilt**2) * axis[:, :, None] * axis[:, None, :]
        covariance: FloatArray = self.noise() + along + self.sigma_tilt**2 * self.S_w @ self.S_w.T
        if self.sigma_directions is not None:
            across = np.eye(3) - self.axes[:, :, None] * self.axes[:, None, :]
            size = (self.sigma_directions * np.linalg.norm(self.angles, axis=1)) ** 2
            covariance += size[:, None, None] * (self.S_w @ across @ self.S_w.T)
        return covariance

    def factor(self, used: BoolArray) -> FloatArray:
        """(3n, 3n) whitening matrix of the used raw turns, with the correlation by ``sigma_face``."""
        n = int(np.count_nonzero(used))
        covariance = np.zeros((n, 3, n, 3))
        covariance[np.arange(n), :, np.arange(n)] = self.covariances()[used]
        if self.faces is not None and self.sigma_face > 0.0:
            faces, angles = self.faces[used], self.angles[used]
            for face in set(faces[faces != 0].tolist()):
                across = np.delete(np.eye(3), abs(face) - 1, axis=1)
                size = np.where(faces == face, angles[:, abs(face) - 1], 0.0)
                moved = self.sigma_face * size[:, None, None] * (self.S_w @ across)
                covariance += np.einsum("ija,kla->ijkl", moved, moved)
        return np.linalg.inv(np.linalg.cholesky(covariance.reshape(3 * n, 3 * n)))

    @property
    def axes(self) -> FloatArray:
        """(k, 3) unit vectors along the turns."""
        size = np.linalg.norm(self.angles, axis=1, keepdims=True)
        return self.angles / np.where(size > 0.0, size, 1.0)

    def noise(self) -> FloatArray:
        """(k, 3, 3) covariance of the raw turns from the sensor alone."""
        hidden = self.measured.hidden
        return self._noise(self.measured.duration_s, None if hidden is None else hidden.variance_of_turns())

    def noise_of_biases(self) -> FloatArray:
        """(z, 3, 3) covariance of the raw integrals of the static intervals."""
        hidden = self.measured.hidden
        return self._noise(self.measured.static_duration_s, None if hidden is None else hidden.variance_of_biases())

    def _noise(self, duration_s: FloatArray, rounding: FloatArray | None) -> FloatArray:
        t = duration_s[:, None]
        variance = self.measured.var_rate * t + self.measured.bias_spread * t**2
        if rounding is not None:
            variance = variance + rounding
        return variance[:, :, None] * np.eye(3)

    @staticmethod
    def designs(angles: FloatArray, duration_s: FloatArray) -> FloatArray:
        """(k, 3, 12) derivative of the raw turns with respect to (S_w row by row, b_w)."""
        matrix = np.zeros((len(angles), 3, 12))
        for i in range(3):
            matrix[:, i, 3 * i : 3 * i + 3] = angles
            matrix[:, i, 9 + i] = duration_s
        return matrix

    def whitened(self, used: BoolArray, with_biases: bool = True) -> tuple[FloatArray, FloatArray]:
        """Whitened design (n, 12) and raw turns (n,) of the used turns, then of the static intervals."""
        measured = self.measured
        factor = self.factor(used)
        design = factor @ self.designs(self.angles[used], measured.duration_s[used]).reshape(-1, 12)
        side = factor @ measured.raw_angle[used].ravel()
        if with_biases:
            still = self.designs(np.zeros_like(measured.static_angle), measured.static_duration_s)
            of_biases = np.linalg.inv(np.linalg.cholesky(self.noise_of_biases()))
            design = np.concatenate([design, (of_biases @ still).reshape(-1, 12)])
            side = np.concatenate([side, (of_biases @ measured.static_angle[:, :, None]).ravel()])
        return design, side

    def pull(self, fit: Solution, used: BoolArray, errors: FloatArray) -> FloatArray:
        """(12, m) change of the solution by shared errors of the turns (k, 3, m), rad."""
        matrix, _ = self.whitened(used, with_biases=False)
        moved = (fit.S_w @ errors[used]).reshape(len(matrix), -1)
        return fit.covariance @ matrix.T @ (self.factor(used) @ moved)

    def correlation(self, fit: Solution, used: BoolArray) -> FloatArray:
        """(12, 12) to add to the solution's covariance for shared rounding errors, which have independent weights."""
        hidden = self.measured.hidden
        if hidden is None:
            return np.zeros((12, 12))
        matrix, _ = self.whitened(used)
        n = 3 * int(np.count_nonzero(used))
        of_biases = np.linalg.inv(np.linalg.cholesky(self.noise_of_biases()))
        errors = np.concatenate([hidden.turns[used], hidden.static])
        # (n, 12, 3): derivative of the solution by an error of each turn or static interval.
        pulls = matrix @ fit.covariance
        of_turns = (self.factor(used).T @ pulls[:n]).reshape(-1, 3, 12)
        still = np.swapaxes(of_biases, 1, 2) @ pulls[n:].reshape(-1, 3, 12)
        gain = np.swapaxes(np.concatenate([of_turns, still]), 1, 2)
        together = np.einsum("rjk,rkm->jm", gain, errors)
        apart = np.einsum("rjk,rk,rlk->jl", gain, np.sum(errors**2, axis=2), gain)
        return np.asarray(together @ together.T - apart)

    def residuals(self, fit: Solution) -> FloatArray:
        """(k, 3) measured minus predicted raw turns."""
        return self.measured.raw_angle - self.angles @ fit.S_w.T - np.outer(self.measured.duration_s, fit.b_w)


@dataclass(frozen=True, eq=False)
class Solution:
    """Inverse form ``S_w``, ``b_w``, its covariance (12, 12) for the stated noise, χ² and degrees of freedom."""

    S_w: FloatArray
    b_w: FloatArray
    covariance: FloatArray
    chi2: float
    dof: int


def solve(system: TurnSystem, used: BoolArray) -> Solution:
    """Weighted least squares over turns and static intervals at once."""
    matrix, side = system.whitened(used)
    size = np.linalg.norm(matrix, axis=0)
    q, r = np.linalg.qr(matrix / size)
    inverse = np.linalg.inv(r)
    solution = (inverse @ (q.T @ side)) / size
    covariance = (inverse @ inverse.T) / np.outer(size, size)
    chi2 = float(np.sum((side - matrix @ solution) ** 2))
    return Solution(solution[:9].reshape(3, 3), solution[9:], covariance, chi2, len(side) - 12)


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Turns predicted by all others: raw ``residual`` (k, 3), its ``covariance`` (k, 3, 3), ``distance2`` (k,).

    NaN where the others do not determine the prediction, and for turns that are not used.
    """

    residual: FloatArray
    covariance: FloatArray
    distance2: FloatArray


def left_out(system: TurnSystem, used: BoolArray) -> LeftOut:
    """Leave-one-out prediction in closed form: ``r₋ᵢ = (Pᵢᵢ)⁻¹ (P y)ᵢ`` with ``P = V⁻¹ − V⁻¹X(XᵀV⁻¹X)⁻¹XᵀV⁻¹``."""
    k, n = len(used), 3 * int(np.count_nonzero(used))
    out = LeftOut(np.full((k, 3), np.nan), np.full((k, 3, 3), np.nan), np.full(k, np.nan))
    matrix, side = system.whitened(used)
    fit = solve(system, used)
    factor = system.factor(used)
    residual = (side - matrix @ np.concatenate([fit.S_w.ravel(), fit.b_w]))[:n]
    projected = factor.T @ (np.eye(n) - matrix[:n] @ fit.covariance @ matrix[:n].T) @ factor
    told = factor.T @ residual
    sizes = np.linalg.cholesky(system.covariances())
    for row, index in enumerate(np.flatnonzero(used)):
        block = slice(3 * row, 3 * row + 3)
        remaining = projected[block, block]
        if np.linalg.eigvalsh(sizes[index].T @ remaining @ sizes[index])[0] < 1e-6:
            continue
        out.covariance[index] = np.linalg.inv(remaining)
        out.residual[index] = out.covariance[index] @ told[block]
        out.distance2[index] = float(told[block] @ out.residual[index])
    return out
