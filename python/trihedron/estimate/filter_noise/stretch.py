"""A stretch of a log beside its reference: observations, columns of constant parameters, covariances of random errors.

The model is linear (docs/reference.md, eq. 1) and Gaussian: the covariance of a stretch is a sum of fixed matrices,
each with one strength; the matrices of slow errors depend on a time constant (docs/filter-noise.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, qr, solve_triangular

from trihedron.arrays import FloatArray, IntArray
from trihedron.records.filter_noise import Nees

NAMES = ("noise", "vibration", "bias_walk", "white", "world", "body", "slow_s", "per_kelvin")
"""Order of the eight strengths of a stretch."""
ALIKE = ("noise", "vibration", "white")
"""Strengths whose errors are equal and independent on the three axes."""
NODES, WEIGHTS = (np.polynomial.legendre.leggauss(3) + np.array([[1.0], [0.0]])) / 2.0
"""Places in a block and their weights: products of two observations' parts are of fourth degree, integrated exactly."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """Observations ``observed`` (3 m,) at ``time_s`` (m,) less their prior mean; ``columns`` (3 m, p) scaled to a prior
    σ of 1.

    ``white`` (m, m) is the covariance, equal on every axis, of the reference's white error for strength 1;
    ``bias_steps`` (3 m, 3 n) the derivative of the observations with respect to the bias in each block; ``tilts``
    (m, 3, 3) the increment that an attitude error in the world frame adds to an observation and to all later ones, None
    where the observation is the angle itself; ``attitude`` (m, 3, 3) body to world; ``power`` (n,) that of vibration in
    each block, with mean 1; ``walk`` (m, 3 n) as `parts_of_walk`; ``white_rad`` a known white error of the attitude in
    each block; ``kelvin`` (n,) the logged temperature less its mean, or None; ``quietest`` [SI/√Hz] the noise density
    of the log's quietest block, above the band: static noise and vibration; ``forgets_s`` the correlation time of a
    Gauss-Markov bias, whose strength is its stationary σ [SI], 0 for a random walk.
    """

    time_s: FloatArray
    observed: FloatArray
    columns: FloatArray
    white: FloatArray
    bias_steps: FloatArray
    tilts: FloatArray | None
    attitude: FloatArray
    power: FloatArray
    walk: FloatArray
    white_rad: float = 0.0
    kelvin: FloatArray | None = None
    quietest: float = 0.0
    forgets_s: float = 0.0

    @cached_property
    def step_s(self) -> float:
        """Time between the observations [s]."""
        return float(np.median(np.diff(self.time_s)))

    @cached_property
    def alike(self) -> tuple[FloatArray, ...]:
        """(m, m) covariances, equal on every axis, of noise, vibration and white error of strength 1."""
        densities = [np.outer(self.step_s * each, WEIGHTS).ravel() for each in (np.ones(len(self.power)), self.power)]
        noise, vibration = (self.walk * density @ self.walk.T for density in densities)
        return noise, vibration, self.white

    @cached_property
    def bias_walk(self) -> FloatArray:
        """(3 m, 3 m) covariance by the bias of strength 1."""
        n = self.bias_steps.shape[1] // 3
        at = self.step_s * np.arange(1, n + 1)
        kernel = np.minimum.outer(at, at)
        if self.forgets_s:
            kernel = np.exp(-np.abs(np.subtract.outer(at, at)) / self.forgets_s)
        return self.bias_steps @ np.kron(kernel, np.eye(3)) @ self.bias_steps.T

    @cached_property
    def warmth(self) -> FloatArray | None:
        """(3 m, 3) derivative of the observations by the bias per kelvin."""
        return None if self.kelvin is None else self.bias_steps @ np.kron(self.kelvin[:, None], np.eye(3))

    @cached_property
    def tilted(self) -> tuple[FloatArray, FloatArray]:
        """(3 m, 3 m) covariances, of increments, for a unit attitude error, world-fixed and body-fixed."""
        added = np.tile(np.eye(3), (len(self.time_s), 1, 1)) if self.tilts is None else self.tilts
        world, body = added.reshape(-1, 3), (added @ self.attitude).reshape(-1, 3)
        return world @ world.T, body @ body.T

    @cached_property
    def given(self) -> FloatArray | float:
        """(3 m, 3 m) covariance of a velocity by the known white attitude error: white acceleration, |f| times it."""
        if self.tilts is None:
            return 0.0
        across = np.einsum("kij,klj->il", self.tilts, self.tilts) / len(self.tilts) * self.white_rad**2
        return np.kron(self.alike[0] / self.step_s, across)

    def covariance(self, strengths: FloatArray) -> FloatArray:
        """Covariance (3 m, 3 m) of all random errors under ``strengths`` (8,) in SI; a strength may be 0."""
        s = dict(zip(NAMES, strengths, strict=True))
        m = len(self.time_s)
        # An observation is a mean over a block; of a velocity's increment over a triangle, as wide as √2 blocks.
        width_s = self.step_s * (1.0 if self.tilts is None else np.sqrt(2.0))
        lag_s = np.subtract.outer(self.time_s, self.time_s)
        out = s["bias_walk"] ** 2 * self.bias_walk
        parted = out.reshape(m, 3, m, 3)
        world, body = self.tilted
        slow = matern_of_means(lag_s, float(s["slow_s"]), width_s).repeat(3, axis=0).repeat(3, axis=1)
        slow = (slow * (s["world"] ** 2 * world + s["body"] ** 2 * body)).reshape(parted.shape)
        parted += slow if self.tilts is None else np.cumsum(np.cumsum(slow, axis=0), axis=2)
        same = sum(s[name] ** 2 * basis for name, basis in zip(ALIKE, self.alike, strict=True))
        for axis in range(3):
            parted[:, axis, :, axis] += same
        if self.warmth is not None:
            out += s["per_kelvin"] ** 2 * self.warmth @ self.warmth.T
        return np.asarray(out + self.given)

    def evidence(self, strengths: FloatArray) -> float:
        """Log evidence of the observations, the columns' coefficients integrated out (docs/reference.md, eq. 2)."""
        return self.evidence_under(self.covariance(strengths))

    def evidence_under(self, V: FloatArray) -> float:
        """Log evidence under a given covariance (3 m, 3 m); -inf where it is singular."""
        try:
            L = cholesky(V, lower=True, check_finite=False)
            half = solve_triangular(L, np.column_stack([self.columns, self.observed]), lower=True, check_finite=False)
            X, y = half[:, :-1], half[:, -1]
            inner = cholesky(np.eye(X.shape[1]) + X.T @ X, lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            # The strengths differ so much that V is singular in double precision.
            return -np.inf
        gain = solve_triangular(inner, X.T @ y, lower=True)
        log_det = np.sum(np.log(np.diag(L))) + np.sum(np.log(np.diag(inner)))
        return float(-0.5 * (y @ y - gain @ gain) - log_det - 0.5 * len(y) * np.log(2.0 * np.pi))

    def factor(self, strengths: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Cholesky factor (3 m, 3 m) of the covariance plus the columns' prior, and whitened observations (3 m,).

        By an orthogonal transformation of the root: the columns' prior is up to 10¹² times the noise in squares.
        """
        root = cholesky(self.covariance(strengths), lower=True, check_finite=False)
        (R,) = qr(np.hstack([self.columns, root]).T, mode="r", overwrite_a=True, check_finite=False)
        n = len(self.observed)
        L = np.asarray(R[:n].T * np.sign(np.diag(R)), dtype=np.float64)
        return L, solve_triangular(L, self.observed, lower=True, check_finite=False)

    def part(self, first: int, last: int) -> Stretch:
        """The stretch of blocks ``first`` to ``last`` (exclusive)."""
        rows, at = slice(3 * first, 3 * last), slice(first, last)
        return replace(
            self,
            time_s=self.time_s[at],
            observed=self.observed[rows],
            columns=self.columns[rows],
            white=self.white[at, at],
            bias_steps=self.bias_steps[rows],
            tilts=None if self.tilts is None else self.tilts[at],
            attitude=self.attitude[at],
            walk=self.walk[at],
        )


def matern(lag_s: FloatArray | float, tau_s: FloatArray | float) -> FloatArray:
    """Matérn-3/2 correlation at lags [s]: the error of a smoothed reference is differentiable."""
    x = np.sqrt(3.0) * lag_s / np.maximum(tau_s, 1e-9)
    return np.asarray((1.0 + x) * np.exp(-x))


def matern_of_means(lag_s: FloatArray, tau_s: float, width_s: float) -> FloatArray:
    """Correlation of means over ``width_s`` of a unit Matérn-3/2 process: second difference of its second integral."""
    rate = np.sqrt(3.0) / max(tau_s, 1e-9)

    def twice_integrated(lag: FloatArray) -> FloatArray:
        t = np.abs(lag)
        return np.asarray((3.0 / rate**2 + t / rate) * np.exp(-rate * t) + 2.0 * t / rate)

    both = twice_integrated(lag_s + width_s) + twice_integrated(lag_s - width_s)
    return np.asarray((both - 2.0 * twice_integrated(lag_s)) / width_s**2)


def parts_of_walk(n: int, *, is_triangle: bool) -> FloatArray:
    """(m, 3 n) part of a step of a random walk, at the nodes of each of ``n`` blocks, in every observation: means over
    the blocks, or (m = n - 1) triangular means over two neighbouring ones."""
    m = n - 1 if is_triangle else n
    out = np.multiply.outer(np.tri(m, n, -1), np.ones(len(NODES)))
    at = np.arange(m)
    out[at, at] = 1.0 - 0.5 * NODES**2 if is_triangle else 1.0 - NODES
    if is_triangle:
        out[at, at + 1] = 0.5 * (1.0 - NODES) ** 2
    return out.reshape(m, -1)


# Errors of a filter without updates over a horizon, against the covariance that it predicts.


def errors_over(stretches: Sequence[tuple[Stretch, int]], draws: FloatArray, horizons_s: Sequence[float]) -> list[Nees]:
    """Errors over each horizon predicted from all earlier observations; of each stretch from block ``first`` on.

    With V = L Lᵀ and w = L⁻¹y the prediction of observation j from those up to k is L[j, :k] w[:k], its covariance
    L[j, k:j] L[j, k:j]ᵀ: one factor gives the filter over every horizon. Means and covariances are those of the mixture
    over ``draws`` (d, 8) of the strengths. A horizon for which no stretch is long enough is left out.
    """
    found: list[list[tuple[FloatArray, FloatArray, int]]] = [[] for _ in horizons_s]
    for stretch, first in stretches:
        ahead = [max(1, round(h / stretch.step_s)) for h in horizons_s]
        targets = [np.arange(max(first, a + 2) + a - 1, len(stretch.time_s)) for a in ahead]
        every = []
        for strengths in draws:
            factor = stretch.factor(strengths)
            every.append([_ahead(*factor, a, some) for a, some in zip(ahead, targets, strict=True)])
        for parts, a, of_draws in zip(found, ahead, zip(*every, strict=True), strict=True):
            errors, covariances = (np.array(one) for one in zip(*of_draws, strict=True))
            middle = errors.mean(axis=0)
            apart = np.einsum("dni,dnj->nij", errors - middle, errors - middle) / len(draws)
            parts.append((middle, covariances.mean(axis=0) + apart, -(-len(middle) // a)))
    return [_nees(h, parts) for h, parts in zip(horizons_s, found, strict=True) if any(one[2] for one in parts)]


def _nees(horizon_s: float, parts: Sequence[tuple[FloatArray, FloatArray, int]]) -> Nees:
    """NEES from errors (n, 3), their covariances (n, 3, 3) and numbers of starts without overlap of all stretches."""
    error, covariance = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    nees = np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[:, :, None])[:, :, 0])
    predicted = float(np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean()))
    actual = float(np.sqrt(np.sum(error**2, axis=1).mean()))
    return Nees(horizon_s, float(nees.mean()), predicted, actual, len(nees), sum(part[2] for part in parts))


def _ahead(L: FloatArray, w: FloatArray, ahead: int, targets: IntArray) -> tuple[FloatArray, FloatArray]:
    """Errors (n, 3) of the blocks ``targets`` (n,) and their covariances (n, 3, 3), by a factor of the covariance."""
    errors, covariances = np.empty((len(targets), 3)), np.empty((len(targets), 3, 3))
    for k, j in enumerate(targets):
        known, last = 3 * (j - ahead + 1), 3 * j + 3
        left = L[last - 3 : last, known:last]
        errors[k], covariances[k] = left @ w[known:last], left @ left.T
    return errors, covariances
