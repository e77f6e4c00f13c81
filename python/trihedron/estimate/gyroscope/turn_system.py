"""Known turns as rows of one least squares, and the errors that their readings do not show alone."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.estimate.gyroscope.turn_angles import MeasuredTurns
from trihedron.estimate.gyroscope.turntable import Predicted
from trihedron.estimate.known_vectors import KnownFit, KnownVectors, fit_known

LARGEST_SIGMA_TURN = math.radians(20.0)
UNKNOWN = 0.3
"""Relative standard error of a scale that only the turns determine: a wrong turn is off by as much at most."""
FLATNESS_RAD, FLATNESS_SPREAD = math.radians(0.05), 0.9
"""Prior of a face's deviation from its nominal plane, one component: 0.04 mm over 50 mm, within a factor of 2.5 either
way (turned and moulded cases: 0.02 to 0.1°); the second is σ of the logarithm."""


@dataclass(frozen=True, eq=False)
class TurnSystem:
    """Turns by known ``angles`` (k, 3) [rad], and the bias as a last row, in rad by the scale ``to_rad`` (3, 3).

    ``sigma_turn`` [rad] is the standard error along a turn, ``sigma_tilt`` that across it (tilt of table, case).
    ``faces`` (k,) is the face (±1, ±2, ±3) of each turn, ``sigma_face`` [rad] the standard deviation of the tilt of a
    face, one component, which all turns on that face share in either sense.
    """

    measured: MeasuredTurns
    angles: FloatArray
    to_rad: FloatArray
    faces: IntArray
    sigma_turn: float = 0.0
    sigma_tilt: float = 0.0
    sigma_face: float = 0.0

    @property
    def axes(self) -> FloatArray:
        """(k, 3) unit vectors along the turns."""
        size = np.linalg.norm(self.angles, axis=1, keepdims=True)
        return self.angles / np.where(size > 0.0, size, 1.0)

    def rows(self) -> KnownVectors:
        """The k turns and the bias."""
        measured = self.measured
        time = measured.duration_s[:, None]
        variance = np.concatenate([measured.var_rate * time + measured.bias_spread * time**2, [measured.var_bias]])
        variance += np.sum(self._apart() ** 2, axis=2)
        noise = self.to_rad @ (variance[:, :, None] * np.eye(3)) @ self.to_rad.T
        along = self.axes[:, :, None] * self.axes[:, None, :]
        noise[:-1] += self.sigma_turn**2 * along + self.sigma_tilt**2 * (np.eye(3) - along)
        of_turns = self._by_faces()
        return KnownVectors(
            raw=np.concatenate([measured.raw_angle, [measured.bias]]) @ self.to_rad.T,
            vectors=np.concatenate([self.angles, np.zeros((1, 3))]),
            times=np.append(measured.duration_s, 1.0),
            noise=noise,
            shared=np.concatenate([of_turns, np.zeros((1, *of_turns.shape[1:]))]),
        )

    def _by_faces(self) -> FloatArray:
        """(k, 3, m) changes of the turns by a standard deviation of each tilt of a face."""
        tilts = [np.zeros((len(self.angles), 3, 0))]
        for face in sorted(set(self.faces.tolist())) if self.sigma_face > 0.0 else []:
            across = np.delete(np.eye(3), abs(face) - 1, axis=1)
            size = np.where(self.faces == face, self.angles[:, abs(face) - 1], 0.0)
            tilts.append(self.sigma_face * size[:, None, None] * across)
        return np.concatenate(tilts, axis=2)

    def _apart(self) -> FloatArray:
        """(k + 1, 3, m) errors by rounding in the weights: as if independent in every turn and interval at rest."""
        apart = self.measured.hidden.copy()
        apart[-1] /= math.sqrt(len(self.measured.static_rates))
        return apart

    def solve(self, used: BoolArray) -> KnownFit:
        """Fit of the ``used`` (k,) turns and the bias."""
        return fit_known(self.rows().of(np.append(used, True)))

    def refined(self, used: BoolArray) -> TurnSystem:
        """The system in rad by the scale of its own fit."""
        return replace(self, to_rad=np.asarray(np.linalg.solve(self.solve(used).S_a, self.to_rad), dtype=np.float64))

    def along(self, used: BoolArray) -> Predicted:
        """Components (n,) of the ``used`` turns along their axes, each axis with a scale that is not known before."""
        axes, size, noise = self.axes[used], np.abs(self.angles[used]), self.rows().noise
        missed = self.measured.turned() @ self.to_rad.T - self.angles @ self.solve(used).S_a.T
        lasts = axes * self.measured.duration_s[used, None]
        own = np.diag(np.einsum("ki,kij,kj->k", axes, noise[:-1][used], axes))
        innovation = own + lasts @ noise[-1] @ lasts.T + UNKNOWN**2 * size @ size.T
        return Predicted(np.einsum("ki,ki->k", missed[used], axes), innovation, n_free=3)

    def scattered(self, used: BoolArray) -> TurnSystem:
        """The system with the scatter that turn angles show, and the tilts beside it."""
        scatter = self.along(used).shown_scatter(np.ones(np.count_nonzero(used)))
        return replace(self, sigma_turn=min(scatter, LARGEST_SIGMA_TURN)).tilted(used) if scatter > 0.0 else self

    def correlation(self, fit: KnownFit, used: BoolArray) -> FloatArray:
        """(12, 12) to add to a fit's covariance for errors by rounding that turns share; their weights are independent.

        They are uniform and equal only where the rate repeats: differences that cancel them are not to be relied on.
        """
        gain, rows = fit.gain() @ self.to_rad, np.append(used, True)
        together = np.einsum("njk,nkm->jm", gain, self.measured.hidden[rows])
        apart = gain @ self._apart()[rows]
        return np.asarray(together @ together.T - np.einsum("njm,nlm->jl", apart, apart))

    def residual(self, fit: KnownFit) -> FloatArray:
        """(k, 3) measured minus predicted turns [rad] by the scale of the system."""
        return self.rows().residual(fit.S_a, fit.b_a)[:-1]

    def left_out(self, used: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Residual (k, 3) of each turn predicted by the others, its covariance (k, 3, 3), χ² (k,); NaN where none."""
        residual, covariance, distance2 = self.solve(used).left_out()
        return _spread(residual[:-1], used), _spread(covariance[:-1], used), _spread(distance2[:-1], used)

    def _noise2(self) -> float:
        """Median variance of a component of a turn by noise, rad²."""
        quiet = replace(self, sigma_turn=0.0, sigma_tilt=0.0).rows()
        return float(np.median(np.einsum("kii->k", quiet.noise[:-1]))) / 3.0

    def tilted(self, used: BoolArray) -> TurnSystem:
        """The system with the tilt of faces, which has a prior, and the tilt that differs from turn to turn: posterior
        mean variances of both by restricted likelihood on a grid.

        Turns on one face share its tilt, which their scatter does not show; opposite faces differ by it. With one face
        alone the prior is kept.
        """
        noise2 = self._noise2()
        log_faces, log_owns = np.linspace(-3.0, 3.0, 9) * FLATNESS_SPREAD, np.linspace(-2.0, 7.0, 7)
        log_weights = np.empty((len(log_faces), len(log_owns)))
        for i, log_face in enumerate(log_faces):
            for j, log_own in enumerate(log_owns):
                own = math.sqrt(noise2) * math.exp(log_own)
                tried = replace(self, sigma_face=FLATNESS_RAD * math.exp(log_face), sigma_tilt=own)
                prior = -0.5 * (log_face / FLATNESS_SPREAD) ** 2 + log_own - math.log1p(math.exp(2.0 * log_own))
                log_weights[i, j] = prior + tried.solve(used).log_likelihood
        weights = np.exp(log_weights - log_weights.max())
        weights /= weights.sum()
        face2 = float(weights.sum(axis=1) @ np.exp(2.0 * log_faces)) * FLATNESS_RAD**2
        own2 = float(weights.sum(axis=0) @ np.exp(2.0 * log_owns)) * noise2
        return replace(self, sigma_face=math.sqrt(face2), sigma_tilt=math.sqrt(own2))


def _spread(values: FloatArray, used: BoolArray) -> FloatArray:
    """Values of the ``used`` (k,) turns as values of all; NaN for the others."""
    out = np.full((len(used), *values.shape[1:]), np.nan)
    out[used] = values
    return out
