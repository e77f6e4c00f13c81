"""The linear system of method 1: ``φ'_i = S_w φ_i + b_w Δt_i + δφ_i`` for turns and zero turns, weighed by noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.estimate.gyroscope.turn_angles import MeasuredTurns
from trihedron.probability import MEDIAN_CHI2, chdtrc, chdtri

FALSE_ALARM = 1e-3
"""Chance that sound turns raise a statistical finding of one kind."""

LARGEST_SIGMA_TURN = math.radians(20.0)
FLATNESS_RAD, FLATNESS_SPREAD = math.radians(0.05), 0.9
"""How far the faces of a case are out of flat, one component: 0.04 mm over 50 mm, within a factor of 2.5 either way
(turned and moulded cases: 0.02 to 0.1°)."""


@dataclass(frozen=True, eq=False)
class TurnSystem:
    """Turns with known ``angles`` (k, 3), rad; a rough ``S_w`` (3, 3) turns ``sigma_turn`` (rad) into raw units.

    ``sigma_turn`` is the standard error of a turn's size, ``sigma_tilt`` that of its axis times the turn (table, case).
    ``sigma_directions`` (k,) rad is the standard error of each turn's axis as it was measured, across itself.
    ``faces`` (k,) says on which face (±1, ±2, ±3; 0 not known) each turn was made, ``sigma_face`` (rad) how far faces
    are out of flat, one component: what all turns on one face share, whichever way they go.
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
        """(k, 3, 3) of each raw turn: rate noise ``N² Δt``, a zero that wanders between holds, the turn's own error."""
        axis = self.axes @ self.S_w.T
        along = (self.sigma_turn**2 - self.sigma_tilt**2) * axis[:, :, None] * axis[:, None, :]
        covariance: FloatArray = self.noise() + along + self.sigma_tilt**2 * self.S_w @ self.S_w.T
        if self.sigma_directions is not None:
            across = np.eye(3) - self.axes[:, :, None] * self.axes[:, None, :]
            size = (self.sigma_directions * np.linalg.norm(self.angles, axis=1)) ** 2
            covariance += size[:, None, None] * (self.S_w @ across @ self.S_w.T)
        return covariance

    def factor(self, used: BoolArray) -> FloatArray:
        """(3n, 3n) that whitens the used raw turns, with what turns on one face share (see ``sigma_face``)."""
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
        out: FloatArray = np.linalg.inv(np.linalg.cholesky(covariance.reshape(3 * n, 3 * n)))
        return out

    @property
    def axes(self) -> FloatArray:
        """(k, 3) unit vectors along the turns."""
        size = np.linalg.norm(self.angles, axis=1, keepdims=True)
        axes: FloatArray = self.angles / np.where(size > 0.0, size, 1.0)
        return axes

    def noise(self) -> FloatArray:
        """(k, 3, 3) of the raw turns from the sensor alone."""
        hidden = self.measured.hidden
        return self._noise(self.measured.duration_s, None if hidden is None else hidden.variance_of_turns())

    def noise_of_zeros(self) -> FloatArray:
        """(z, 3, 3) of the raw zero turns."""
        hidden = self.measured.hidden
        return self._noise(self.measured.zero_duration_s, None if hidden is None else hidden.variance_of_zeros())

    def _noise(self, duration_s: FloatArray, rounding: FloatArray | None) -> FloatArray:
        t = duration_s[:, None]
        variance = self.measured.var_rate * t + self.measured.zero_spread * t**2
        if rounding is not None:
            variance = variance + rounding
        noise: FloatArray = variance[:, :, None] * np.eye(3)
        return noise

    @staticmethod
    def designs(angles: FloatArray, duration_s: FloatArray) -> FloatArray:
        """(k, 3, 12) derivative of the raw turns with respect to (S_w row by row, b_w)."""
        matrix = np.zeros((len(angles), 3, 12))
        for i in range(3):
            matrix[:, i, 3 * i : 3 * i + 3] = angles
            matrix[:, i, 9 + i] = duration_s
        return matrix

    def whitened(self, used: BoolArray, with_zeros: bool = True) -> tuple[FloatArray, FloatArray]:
        """Whitened design (n, 12) and raw turns (n,) of the used turns, then of the zero turns."""
        measured = self.measured
        factor = self.factor(used)
        design = factor @ self.designs(self.angles[used], measured.duration_s[used]).reshape(-1, 12)
        side = factor @ measured.raw_angle[used].ravel()
        if with_zeros:
            still = self.designs(np.zeros_like(measured.zero_angle), measured.zero_duration_s)
            of_zeros = np.linalg.inv(np.linalg.cholesky(self.noise_of_zeros()))
            design = np.concatenate([design, (of_zeros @ still).reshape(-1, 12)])
            side = np.concatenate([side, (of_zeros @ measured.zero_angle[:, :, None]).ravel()])
        return design, side

    def pull(self, fit: Solution, used: BoolArray, errors: FloatArray) -> FloatArray:
        """(12, m) by what errors of the turns (k, 3, m), rad, that all of them share, pull the solution."""
        matrix, _ = self.whitened(used, with_zeros=False)
        moved = (fit.S_w @ errors[used]).reshape(len(matrix), -1)
        out: FloatArray = fit.covariance @ matrix.T @ (self.factor(used) @ moved)
        return out

    def correlation(self, fit: Solution, used: BoolArray) -> FloatArray:
        """(12, 12) to add to the solution's covariance where rounding errors are shared: weights take none as so."""
        hidden = self.measured.hidden
        if hidden is None:
            return np.zeros((12, 12))
        matrix, _ = self.whitened(used)
        n = 3 * int(np.count_nonzero(used))
        of_zeros = np.linalg.inv(np.linalg.cholesky(self.noise_of_zeros()))
        errors = np.concatenate([hidden.turns[used], hidden.zeros])
        # (n, 12, 3): by what an error of each row pulls the solution.
        pulls = matrix @ fit.covariance
        of_turns = (self.factor(used).T @ pulls[:n]).reshape(-1, 3, 12)
        still = np.swapaxes(of_zeros, 1, 2) @ pulls[n:].reshape(-1, 3, 12)
        gain = np.swapaxes(np.concatenate([of_turns, still]), 1, 2)
        together = np.einsum("rjk,rkm->jm", gain, errors)
        apart = np.einsum("rjk,rk,rlk->jl", gain, np.sum(errors**2, axis=2), gain)
        out: FloatArray = together @ together.T - apart
        return out

    def residuals(self, fit: Solution) -> FloatArray:
        """(k, 3) measured minus predicted raw turns."""
        out: FloatArray = (
            self.measured.raw_angle - self.angles @ fit.S_w.T - np.outer(self.measured.duration_s, fit.b_w)
        )
        return out


@dataclass(frozen=True, eq=False)
class Solution:
    """Inverse form ``S_w``, ``b_w``, its covariance (12, 12) for the stated noise, χ² and degrees of freedom."""

    S_w: FloatArray
    b_w: FloatArray
    covariance: FloatArray
    chi2: float
    dof: int


def solve(system: TurnSystem, used: BoolArray) -> Solution:
    """Weighted least squares over turns and zero turns at once."""
    matrix, side = system.whitened(used)
    size = np.linalg.norm(matrix, axis=0)
    q, r = np.linalg.qr(matrix / size)
    inverse = np.linalg.inv(r)
    solution = (inverse @ (q.T @ side)) / size
    covariance = (inverse @ inverse.T) / np.outer(size, size)
    chi2 = float(np.sum((side - matrix @ solution) ** 2))
    return Solution(solution[:9].reshape(3, 3), solution[9:], covariance, chi2, len(side) - 12)


def solve_zero_first(system: TurnSystem, used: BoolArray) -> Solution:
    """``b_w`` from the zero turns alone, then ``S_w`` by least squares from the turns freed of it.

    The error of ``b_w`` reaches ``S_w`` through every turn at once: ``δS_w = −G δb_w``.
    """
    measured = system.measured
    zero_s = measured.zero_duration_s[:, None]
    var = measured.var_rate / zero_s + measured.zero_spread
    weight = 1.0 / var
    total = weight.sum(axis=0)
    rates = measured.zero_angle / zero_s
    b_w = (weight * rates).sum(axis=0) / total
    cov_b = np.diag(1.0 / total)
    if measured.hidden is not None:
        # What a step hides of the zero is the same in every zero turn.
        cov_b += np.diag(np.mean(measured.hidden.variance_of_zeros() / zero_s**2, axis=0))
    chi2 = float(np.sum(weight * (rates - b_w) ** 2))
    matrix, side = system.whitened(used, with_zeros=False)
    to_scale, to_bias = matrix[:, :9], matrix[:, 9:]
    inner = np.linalg.inv(to_scale.T @ to_scale)
    gain = inner @ to_scale.T
    scale = gain @ (side - to_bias @ b_w)
    through = -gain @ to_bias
    covariance = np.zeros((12, 12))
    covariance[:9, :9] = inner + through @ cov_b @ through.T
    covariance[:9, 9:] = through @ cov_b
    covariance[9:, :9] = covariance[:9, 9:].T
    covariance[9:, 9:] = cov_b
    chi2 += float(np.sum((side - to_bias @ b_w - to_scale @ scale) ** 2))
    return Solution(scale.reshape(3, 3), b_w, covariance, chi2, len(side) - 9 + 3 * len(rates) - 3)


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


@dataclass(frozen=True, eq=False)
class Screened:
    """What remains: ``used`` turns, ``suspects`` that the others contradict, those of them that were ``removed``."""

    system: TurnSystem
    used: BoolArray
    suspects: tuple[int, ...]
    removed: tuple[int, ...]
    unchecked_axes: tuple[int, ...]


def screen(system: TurnSystem, used: BoolArray, sigma_turn_rad: float | None) -> Screened:
    """Find turns that the others contradict, and the standard error of a turn when it is not given.

    Each turn is predicted by all others. The scatter of a turn is first read from the median of these predictions,
    which one wrong turn does not move; a turn far beyond it is a suspect. It is removed when two others about its
    axis remain to say so. The scatter is then that of the rest, zero where the rate noise explains it.
    """
    axes = np.argmax(np.abs(system.angles), axis=1)
    counts = {axis: int(np.count_nonzero(used & (axes == axis))) for axis in range(3)}
    unchecked = tuple(axis for axis in range(3) if counts[axis] < 2)
    suspects: list[int] = []
    removed: list[int] = []
    system = _with_tilts(replace(system, S_w=solve(system, used).S_w), used)
    while True:
        distances = _distances(_with_scatter(system, used, sigma_turn_rad), used)
        if not distances:
            break
        limit = float(chdtri(3, FALSE_ALARM / len(distances)))
        worst = max(distances, key=lambda index: distances[index])
        if distances[worst] <= limit:
            break
        if np.count_nonzero(used & (axes == axes[worst])) < 3:
            suspects += [i for i in distances if axes[i] == axes[worst] and distances[i] > limit and i not in suspects]
            break
        suspects.append(worst)
        removed.append(worst)
        used = used.copy()
        used[worst] = False
    if sigma_turn_rad is None:
        system = _matching_scatter(system, used)
    else:
        system = replace(system, sigma_turn=sigma_turn_rad)
    return Screened(system, used, tuple(suspects), tuple(removed), unchecked)


def _distances(system: TurnSystem, used: BoolArray) -> dict[int, float]:
    distance2 = left_out(system, used).distance2
    return {int(i): float(distance2[i]) for i in np.flatnonzero(np.isfinite(distance2))}


def _with_scatter(system: TurnSystem, used: BoolArray, sigma_turn_rad: float | None) -> TurnSystem:
    """The scatter of a turn from the median of the predictions: one wrong turn does not move it."""
    if sigma_turn_rad is not None:
        return replace(system, sigma_turn=sigma_turn_rad)
    for _ in range(3):
        along2, across2, noise2 = _components(system, left_out(system, used).residual)
        known = used & np.isfinite(along2)
        if not np.any(known):
            return system
        system = replace(system, sigma_turn=_beyond(float(np.median(along2[known])) / MEDIAN_CHI2[1], noise2))
        if system.sigma_face == 0.0:
            tilt = _beyond(float(np.median(across2[known])) / MEDIAN_CHI2[2], noise2)
            system = replace(system, sigma_tilt=tilt)
    return system


def _matching_scatter(system: TurnSystem, used: BoolArray) -> TurnSystem:
    """Scatter along and across the turns by moments, where the rate noise does not explain the residuals; that across
    wherever it is seen.

    A case that lies flat to some hundredths of a degree scatters as much as the noise of a turn, which no test shows in
    twelve turns: left out for want of proof, 95 % intervals held 91 %. Turns that follow each other about one axis
    share how the case lies: as many of them count as one.
    """
    system = _with_tilts(replace(system, sigma_turn=0.0, sigma_tilt=0.0), used)
    if system.sigma_face > 0.0:
        return _with_turns_astray(system, used)
    fit = solve(system, used)
    if fit.dof < 1:
        return system
    if chdtrc(fit.dof, fit.chi2) > FALSE_ALARM:
        _, across2, noise2 = _components(system, system.residuals(fit))
        k = int(np.count_nonzero(used))
        beyond = _beyond(float(np.sum(across2[used])) / max(2 * k - 6, 1), noise2)
        return replace(system, sigma_tilt=beyond * math.sqrt(_turns_a_placement(system.angles[used])))
    k = int(np.count_nonzero(used))
    for _ in range(3):
        along2, across2, noise2 = _components(system, system.residuals(solve(system, used)))
        # Each axis spends one parameter along its turns and two across them.
        system = replace(
            system,
            sigma_turn=_beyond(float(np.sum(along2[used])) / max(k - 3, 1), noise2),
            sigma_tilt=_beyond(float(np.sum(across2[used])) / max(2 * k - 6, 1), noise2),
        )
    return system


def _with_turns_astray(system: TurnSystem, used: BoolArray) -> TurnSystem:
    """The scatter of turns' sizes by moments, where noise and tilts do not explain the residuals."""
    fit = solve(system, used)
    if fit.dof < 1 or chdtrc(fit.dof, fit.chi2) > FALSE_ALARM:
        return system
    k = int(np.count_nonzero(used))
    for _ in range(3):
        along2, _, noise2 = _components(system, system.residuals(solve(system, used)))
        system = replace(system, sigma_turn=_beyond(float(np.sum(along2[used])) / max(k - 3, 1), noise2))
        system = _with_tilts(system, used)
    return system


def _with_tilts(system: TurnSystem, used: BoolArray) -> TurnSystem:
    """How far faces are out of flat, and how differently the case lies at every turn: mean variances over what the
    turns leave likely of both (restricted likelihood on a grid), the first with a prior.

    Turns on one face share its tilt, so that their own scatter does not show it; opposite faces differ by it, and one
    face alone says nothing: the prior then stands. Where faces are not known turns are taken to lie each their own way.
    """
    if system.faces is None or not np.all(system.faces[used] != 0):
        return system
    _, _, noise2 = _components(system, system.residuals(solve(system, used)))
    own_scale = math.sqrt(noise2)
    log_faces, log_owns = np.linspace(-3.0, 3.0, 9) * FLATNESS_SPREAD, np.linspace(-2.0, 7.0, 7)
    log_weights = np.empty((len(log_faces), len(log_owns)))
    for i, log_face in enumerate(log_faces):
        for j, log_own in enumerate(log_owns):
            tried = replace(
                system, sigma_face=FLATNESS_RAD * math.exp(log_face), sigma_tilt=own_scale * math.exp(log_own)
            )
            prior = -0.5 * (log_face / FLATNESS_SPREAD) ** 2 + log_own - math.log1p(math.exp(2.0 * log_own))
            log_weights[i, j] = prior + _restricted_likelihood(tried, used)
    weights = np.exp(log_weights - log_weights.max())
    weights /= weights.sum()
    face2 = float(weights.sum(axis=1) @ np.exp(2.0 * log_faces)) * FLATNESS_RAD**2
    own2 = float(weights.sum(axis=0) @ np.exp(2.0 * log_owns)) * noise2
    return replace(system, sigma_face=math.sqrt(face2), sigma_tilt=math.sqrt(own2))


def _restricted_likelihood(system: TurnSystem, used: BoolArray) -> float:
    matrix, side = system.whitened(used)
    q, r = np.linalg.qr(matrix)
    rest = side - q @ (q.T @ side)
    log_factor = float(np.sum(np.log(np.abs(np.diag(system.factor(used))))))
    return log_factor - float(np.sum(np.log(np.abs(np.diag(r))))) - 0.5 * float(rest @ rest)


def _turns_a_placement(angles: FloatArray) -> float:
    """How many turns follow each other about one axis, on the average."""
    axis = np.argmax(np.abs(angles), axis=1)
    return len(axis) / (1.0 + float(np.count_nonzero(np.diff(axis))))


def _components(system: TurnSystem, raw: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Squares (k,) along and across each turn, rad², of raw deviations (k, 3), and the variance that noise alone
    gives."""
    to_si = np.linalg.inv(system.S_w)
    deviation = raw @ to_si.T
    along = np.einsum("ki,ki->k", deviation, system.axes)
    noise = np.einsum("kii->k", to_si @ system.noise() @ to_si.T) / 3.0
    return along**2, np.maximum(np.sum(deviation**2, axis=1) - along**2, 0.0), float(np.median(noise))


def _beyond(mean_square: float, noise2: float) -> float:
    return min(math.sqrt(max(mean_square - noise2, 0.0)), LARGEST_SIGMA_TURN)
