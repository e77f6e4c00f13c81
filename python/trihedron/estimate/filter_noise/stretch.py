"""A stretch of a log beside its reference: observations, columns of what is constant, covariances of what is random.

Everything is linear (docs/reference.md, eq. 1) and Gaussian, so the covariance of a whole stretch is a sum of fixed
matrices, each with one strength; those of slow errors change with a time constant (docs/filter-noise.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from trihedron.arrays import FloatArray

AnyFloats = np.ndarray[Any, np.dtype[Any]]

NAMES = ("noise", "vibration", "bias_walk", "white", "world", "body", "slow_s")
"""Strengths of a stretch, in this order."""
ALIKE = ("noise", "vibration", "white")
"""Those whose errors have the same size along every axis."""
BLOCK_ENDS, TRIANGLE_ENDS = (1.0 / 6.0, 0.0), (7.0 / 30.0, 1.0 / 120.0)
"""A mean over a block has a third of the block's variance, and not half; a triangular one over two blocks 4/15."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """Observations ``observed`` (3 m,) at ``time_s`` (m,), columns (3 m, p) in units of their prior, p standard normal.

    ``centre`` (p,) is where that prior stands; ``alike`` the covariances (m, m), the same along every axis, of noise,
    vibration and white error of the reference for strength one, ``bias_walk`` (3 m, 3 m) that of a bias that walks;
    ``tilts`` (m, 3, 3) what an attitude error of the world up to an observation adds to it and to all later ones, None
    where it is the observation itself; ``given`` (3 m, 3 m) a covariance that is known, or None;
    ``attitude`` (m, 3, 3) is the body's; ``bias_steps`` (3 m, 3 m) is what a bias of each block does to the
    observations; ``power`` (m,) the vibration's, mean one; ``ends`` the parts of a block's variance by which a mean of
    a walk, and two neighbouring ones, have less than min(t, t') of their middles; ``kelvin`` (m,) a logged
    temperature about its mean, whose bias is the last three columns, in units of ``kelvin_size`` [SI/K].
    """

    time_s: FloatArray
    observed: FloatArray
    columns: FloatArray
    centre: FloatArray
    alike: tuple[AnyFloats, ...]
    bias_walk: AnyFloats
    bias_steps: FloatArray
    tilts: FloatArray | None
    attitude: FloatArray
    power: FloatArray
    ends: tuple[float, float] = BLOCK_ENDS
    kelvin: FloatArray | None = None
    kelvin_size: float = 0.0
    given: AnyFloats | None = None

    @cached_property
    def tilted(self) -> tuple[FloatArray, FloatArray]:
        """(m, 3, m, 3) covariances of what one attitude error of the world, and of the body, adds at all times."""
        assert self.tilts is not None
        own = self.tilts @ self.attitude
        world, body = (np.asarray(np.einsum("kij,lmj->kilm", by, by)) for by in (self.tilts, own))
        return world, body

    @cached_property
    def turned(self) -> FloatArray:
        """(m, 3, m, 3) the bodies' attitudes to one another."""
        return np.asarray(np.einsum("kij,lmj->kilm", self.attitude, self.attitude))

    @cached_property
    def lag_s(self) -> FloatArray:
        """(m, m) between the observations."""
        return np.abs(np.subtract.outer(self.time_s, self.time_s))

    def covariance(self, strengths: FloatArray) -> FloatArray:
        """(3 m, 3 m) of everything random, under strengths (7,) in SI, a zero being none."""
        s = dict(zip(NAMES, strengths, strict=True))
        m = len(self.time_s)
        correlation = matern(self.lag_s, s["slow_s"])
        out = s["bias_walk"] ** 2 * self.bias_walk
        parted = out.reshape(m, 3, m, 3)
        same = sum(s[name] ** 2 * basis for name, basis in zip(ALIKE, self.alike, strict=True))
        if self.tilts is None:
            same = same + s["world"] ** 2 * correlation
            if s["body"] > 0.0:
                parted += s["body"] ** 2 * correlation[:, None, :, None] * self.turned
        elif s["world"] > 0.0 or s["body"] > 0.0:
            world, body = self.tilted
            added = correlation[:, None, :, None] * (s["world"] ** 2 * world + s["body"] ** 2 * body)
            parted += np.cumsum(np.cumsum(added, axis=0), axis=2)
        for axis in range(3):
            parted[:, axis, :, axis] += same
        return np.asarray(out if self.given is None else out + self.given)

    def evidence(self, strengths: FloatArray) -> float:
        """Log evidence of the observations, the columns' coefficients integrated out (docs/reference.md, eq. 2)."""
        return self.evidence_under(self.covariance(strengths))

    def evidence_under(self, V: FloatArray) -> float:
        """The same under any covariance (3 m, 3 m)."""
        try:
            L = cholesky(V, lower=True, check_finite=False)
            half = solve_triangular(L, np.column_stack([self.columns, self.observed]), lower=True, check_finite=False)
            X, y = half[:, :-1], half[:, -1] - half[:, :-1] @ self.centre
            inner = cholesky(np.eye(X.shape[1]) + X.T @ X, lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            # Strengths so unlike that V is singular to working precision.
            return -np.inf
        gain = solve_triangular(inner, X.T @ y, lower=True)
        log_det = np.sum(np.log(np.diag(L))) + np.sum(np.log(np.diag(inner)))
        return float(-0.5 * (y @ y - gain @ gain) - log_det - 0.5 * len(y) * np.log(2.0 * np.pi))

    def coefficients(self, strengths: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Posterior mean (p,) and covariance (p, p) of the columns' coefficients, beside ``centre``."""
        L = cholesky(self.covariance(strengths), lower=True, check_finite=False)
        y = self.observed - self.columns @ self.centre
        half = solve_triangular(L, np.column_stack([self.columns, y]), lower=True, check_finite=False)
        covariance = np.asarray(np.linalg.inv(np.eye(self.columns.shape[1]) + half[:, :-1].T @ half[:, :-1]), float)
        return covariance @ (half[:, :-1].T @ half[:, -1]), covariance

    def factor(self, strengths: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Cholesky factor (3 m, 3 m) of the covariance with the columns' prior in it, and whitened observations."""
        V = self.covariance(strengths) + self.columns @ self.columns.T
        L = cholesky(V, lower=True, check_finite=False)
        return L, solve_triangular(L, self.observed - self.columns @ self.centre, lower=True, check_finite=False)

    def part(self, first: int, last: int) -> Stretch:
        """Blocks from ``first`` up to ``last``."""
        rows = slice(3 * first, 3 * last)
        at = slice(first, last)
        return replace(
            self,
            time_s=self.time_s[at],
            observed=self.observed[rows],
            columns=self.columns[rows],
            alike=tuple(basis[at, at] for basis in self.alike),
            bias_walk=self.bias_walk[rows, rows],
            bias_steps=self.bias_steps[rows],
            tilts=None if self.tilts is None else self.tilts[at],
            given=None if self.given is None else self.given[rows, rows],
            attitude=self.attitude[at],
            power=self.power[at],
            kelvin=None if self.kelvin is None else self.kelvin[at],
        )

    def with_gauss_markov(self, correlation_time_s: float) -> Stretch:
        """The bias as a Gauss-Markov process of that time constant, its strength the σ [SI]."""
        steps = self.bias_steps.shape[1] // 3
        h = float(np.median(np.diff(self.time_s)))
        lag = np.abs(np.subtract.outer(np.arange(steps), np.arange(steps))) * h
        kernel = np.kron(np.exp(-lag / correlation_time_s), np.eye(3))
        return replace(self, bias_walk=self.bias_steps @ kernel @ self.bias_steps.T)


def matern(lag_s: FloatArray | float, tau_s: FloatArray | float) -> FloatArray:
    """Matérn-3/2 correlation over some lags: a smoothed truth has a derivative."""
    x = np.sqrt(3.0) * lag_s / np.maximum(tau_s, 1e-9)
    return np.asarray((1.0 + x) * np.exp(-x))


def accumulated(per_block: FloatArray, ends: tuple[float, float]) -> FloatArray:
    """(m, m) covariance of means of a walk with a rate of its own in every block (m,): min(t, t') of their middles,
    less what ``ends`` says."""
    upto = np.cumsum(per_block) - 0.5 * per_block
    neighbours = np.eye(len(upto), k=1) + np.eye(len(upto), k=-1)
    less = np.diag(ends[0] * per_block) + ends[1] * per_block.mean() * neighbours
    return np.asarray(np.minimum.outer(upto, upto) - less)


def walked(steps: FloatArray) -> FloatArray:
    """Covariance (3 m, 3 m) of a bias that walks by one per block: ``steps`` (3 m, 3 m) is what each block's does."""
    # From block j on all later ones carry the change: sums from behind.
    m = steps.shape[1] // 3
    carried = np.cumsum(steps.reshape(len(steps), m, 3)[:, ::-1], axis=1)[:, ::-1].reshape(len(steps), -1)
    return np.asarray(carried @ carried.T)
