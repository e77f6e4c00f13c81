"""One Gaussian process for a bias in static poses: scatter, walk, drift (docs/static-logs.md, R.7, R.8).

Of one axis ``y = X θ + e``, flat prior on θ, ``V = φ² diag σ² + σ_s² (ones within a pose) + σ_w² W + σ_d² D``; W is a
random walk, D an integrated walk whose initial slope is random too, both scaled so that σ_w and σ_d are the expected
rms about the mean of the session. All strengths are always free, so that coefficients are tested against the noise that
the biases have.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray

SCATTER, WALK, DRIFT, NOISE = range(4)
STRENGTHS = (SCATTER, WALK, DRIFT)
LEVELS = 6
"""Levels of each σ on the grid besides 0, a factor of 2.5 to 4 apart; the best is refined."""
LEAST_LEVEL = 1e-3
"""Least σ over the largest: what a strength adds to the scatter of the readings is then a millionth of it."""
NOISE_LEVELS = (1.0, 2.0, 4.0, 8.0)
"""φ on the grid: a low-pass filter of an eighth of the bandwidth hides as much from the differences of neighbours."""
AROUND = np.array([0.4, 0.65, 1.0, 1.5, 2.5])
"""Levels of a strength relative to its best value over which coefficients are averaged: its uncertainty is 10 to
30 %."""
FIRST_STEP, ENOUGH = 0.4, 0.02
"""First steps of the logarithms of strengths, half of a level's; error of the largest log-likelihood."""
NEGLIGIBLE = 1e-12
"""Share of a diagonal below rounding errors, against singular matrices."""


@dataclass(frozen=True, eq=False)
class BiasReadings:
    """Biases of one sensor, two means per pose or more, in the order of time.

    ``values``, ``sigma`` (axes, n) the means and their standard errors; ``time_s`` (n,) their middles, ``length_s``
    (n,) the duration of each, ``pose`` (n,) number of the pose; ``design`` (n, p) columns of the mean, the constant
    first.
    """

    values: FloatArray
    sigma: FloatArray
    time_s: FloatArray
    length_s: FloatArray
    pose: npt.NDArray[np.int64]
    design: FloatArray

    @cached_property
    def levels(self) -> FloatArray:
        """(LEVELS,) σ of the grid besides 0: from a fifth of the means' error to six times the total scatter."""
        own, spread = float(np.median(self.sigma)), float(np.mean(self.values.std(axis=1)))
        most = max(6.0 * spread, 3.0 * own)
        return np.geomspace(max(0.2 * own, LEAST_LEVEL * most), most, LEVELS)


@dataclass(frozen=True, eq=False)
class Grams:
    """Whitened products of readings and design for every row of strengths (g, 4): (g,), (g, c, c)."""

    strengths: FloatArray
    log_det: FloatArray
    gram: FloatArray

    def __getitem__(self, rows: npt.NDArray[np.intp]) -> Grams:
        return Grams(self.strengths[rows], self.log_det[rows], self.gram[rows])

    def log_likelihood(self, keep: Sequence[int], *, restricted: bool) -> FloatArray:
        """(g,) log-likelihood with the columns ``keep`` in the mean, restricted (REML) or not."""
        theta, inverse = self.estimates(keep)
        side = self.gram[:, [k + 1 for k in keep], 0]
        out = -0.5 * (self.log_det + self.gram[:, 0, 0] - np.einsum("gk,gk->g", side, theta))
        return np.asarray(out + 0.5 * np.linalg.slogdet(inverse)[1] if restricted else out)

    def estimates(self, keep: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Generalised least squares: (g, k) coefficients and (g, k, k) covariances."""
        index = [k + 1 for k in keep]
        A = self.gram[:, index][:, :, index]
        scale = np.sqrt(np.maximum(np.einsum("gii->gi", A), np.finfo(float).tiny))
        both = scale[:, :, None] * scale[:, None, :]
        inverse = np.linalg.inv(A / both + NEGLIGIBLE * np.eye(len(index))) / both
        return np.einsum("gkl,gl->gk", inverse, self.gram[:, index, 0]), inverse


@dataclass(frozen=True, eq=False)
class BiasProcess:
    """The likelihood of one axis under every mixture of scatter, walk, drift and noise of the means."""

    readings: BiasReadings
    axis: int

    @cached_property
    def span_s(self) -> float:
        return float(np.ptp(self.readings.time_s))

    @cached_property
    def sizes(self) -> FloatArray:
        """(2,) mean square about the mean of a walk and of a drift of unit strength."""
        t = self._elapsed(self.readings.time_s)
        return np.array([np.mean(np.diag(kernel)) - kernel.mean() for kernel in _kernels(t, t)])

    def _elapsed(self, time_s: FloatArray) -> FloatArray:
        return np.asarray(np.clip((time_s - self.readings.time_s[0]) / self.span_s, 0.0, 1.0))

    @cached_property
    def grid(self) -> Grams:
        return self.grams([np.concatenate([[0.0], self.readings.levels])] * 3 + [np.array(NOISE_LEVELS)])

    def grams(self, levels: Sequence[FloatArray]) -> Grams:
        """Whitened products at every combination of ``levels`` of scatter, walk, drift and noise."""
        r = self.readings
        rows = np.stack(np.meshgrid(*levels, indexing="ij"), axis=-1).reshape(-1, 4)
        s, w, d, noise = rows.T**2
        walk, drift = self.sizes
        # The slope of the drift at the start has the variance that it gains in the session.
        rates = np.stack([s, w / walk, d / drift, d / drift, noise], axis=1)
        log_det, gram = _core.bias_process_grams(
            np.column_stack([r.values[self.axis], r.design]), r.sigma[self.axis] ** 2, self._elapsed(r.time_s),
            r.length_s / self.span_s, r.pose, np.ones((len(r.pose), 1)), rates,
        )  # fmt: skip
        return Grams(rows, log_det, gram)

    def estimates(self, keep: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Coefficients (k,) and covariance (k, k) averaged over the strengths by their likelihood, flat in log σ."""
        _, best = maximum([self], STRENGTHS, keep, restricted=True)
        part = self.grams([one * AROUND for one in np.maximum(best, self.readings.levels[0])])
        value = part.log_likelihood(keep, restricted=True)
        weight = np.exp(value - value.max())
        weight /= weight.sum()
        theta, covariance = part.estimates(keep)
        mean = weight @ theta
        away = theta - mean
        return mean, np.tensordot(weight, covariance + away[:, :, None] * away[:, None, :], axes=1)

    def slow_path(
        self, keep: Sequence[int], strengths: FloatArray, time_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Mean and standard error (m,) of walk plus drift at ``time_s`` (m,), about its mean over those times."""
        r = self.readings
        y, X, length = r.values[self.axis], r.design[:, keep], r.length_s / self.span_s
        t, at = self._elapsed(r.time_s), self._elapsed(time_s)
        s, w, d, noise = strengths**2
        walk, drift = np.array([w, d]) / self.sizes

        def slow(a: FloatArray, b: FloatArray) -> FloatArray:
            low, bent = _kernels(a, b)
            return np.asarray(walk * low + drift * bent)

        # The mean over an interval of a walk has less variance than its middle, by a sixth of that gained in it.
        V = slow(t, t) - np.diag(walk * length / 6.0) + s * (r.pose[:, None] == r.pose)
        inverse = np.linalg.inv(V + np.diag(noise * r.sigma[self.axis] ** 2))
        side = inverse @ X
        P = inverse - side @ np.linalg.pinv(X.T @ side) @ side.T
        centre = np.eye(len(at)) - 1.0 / len(at)
        # Covariance of a value of the walk with its mean over an interval around it.
        inside = np.maximum(0.5 * length - np.abs(at[:, None] - t), 0.0)
        cross = centre @ (slow(at, t) - walk * inside**2 / (2.0 * length))
        covariance = centre @ slow(at, at) @ centre - cross @ P @ cross.T
        return cross @ P @ y, np.sqrt(np.maximum(np.diag(covariance), 0.0))


def maximum(
    axes: Sequence[BiasProcess], free: Collection[int], keep: Sequence[int], *, restricted: bool
) -> tuple[float, FloatArray]:
    """Largest log-likelihood of some axes with strengths ``free`` beside the noise, the others 0; and the four there.

    The axes have them in common: together they determine a strength better than each alone.
    """
    held = [k for k in STRENGTHS if k not in free]
    rows = np.flatnonzero((axes[0].grid.strengths[:, held] == 0.0).all(axis=1))
    value = sum(one.grid[rows].log_likelihood(keep, restricted=restricted) for one in axes)
    best, live = axes[0].grid.strengths[rows[np.argmax(value)]], [*free, NOISE]
    best[live] = np.maximum(best[live], axes[0].readings.levels[0])

    def loss(logs: FloatArray) -> float:
        at = best.copy()
        at[live] = np.exp(logs)
        return -sum(float(one.grams(at[:, None]).log_likelihood(keep, restricted=restricted)[0]) for one in axes)

    # White noise is measured between neighbouring samples: the means have at least that. No strength exceeds the
    # grid's: swings are smoother than an integrated walk, whose best strength is far beyond what the readings scatter.
    most = np.log(axes[0].readings.levels[-1])
    bounds = [(0.0, np.inf) if k == NOISE else (-np.inf, most) for k in live]
    start = np.log(best[live])
    corners = np.vstack([start, start + FIRST_STEP * np.eye(len(start))])
    options: Any = {"initial_simplex": corners, "fatol": ENOUGH, "xatol": ENOUGH}
    from scipy.optimize import minimize  # imported here: sessions of many poses do without

    found = minimize(loss, start, method="Nelder-Mead", bounds=bounds, options=options)
    best[live] = np.exp(found.x)
    return -float(found.fun), best


def _kernels(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Covariances of a walk, and of an integrated walk with a random initial slope, at times ``a`` and ``b``."""
    low, high = np.minimum.outer(a, b), np.maximum.outer(a, b)
    return low, low**2 * (3.0 * high - low) / 6.0 + np.outer(a, b)
