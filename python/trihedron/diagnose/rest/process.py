"""One Gaussian process for a bias in static poses: scatter, walk, drift (docs/static-logs.md, R.7, R.8).

Per axis ``y = X θ + e``, flat prior on θ, ``V = φ² diag σ² + σ_s² (ones within a pose) + σ_w² W + σ_d² D``; W is a
random walk, D an integrated walk whose initial slope is random too, both scaled so that σ_w and σ_d are the expected
rms about the mean of the session. All three strengths are always free, so that coefficients are tested against the
noise that the biases have.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.special import chdtrc

from trihedron import _core
from trihedron.arrays import FloatArray

SCATTER, WALK, DRIFT = 0, 1, 2
INITIAL_SLOPE = 1.0
"""Variance of the drift's initial slope over its increase in the session: a straight line is a drift too."""
LEVELS = 6
"""Levels of each σ on the grid besides 0, a factor of 2.5 to 4 apart; the best is refined."""
POLISH = (1.8, 1.35, 1.15)
"""Factors by which the best grid point is refined in turn."""
AXIS_FACTORS = tuple(float(2.0 ** (k / 2)) for k in range(-6, 7))
UNEQUAL_AXES = 20.0
"""Twice the log-likelihood that different sizes per axis must gain: p = 5e-5 of χ² with two degrees of freedom."""
AROUND = (0.3, 0.5, 0.7, 0.85, 1.0, 1.2, 1.45, 2.0, 3.3)
"""Levels of a σ relative to its best value over which coefficients are averaged: its uncertainty is 10 to 30 %."""
NOISE_FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0, 9.0, 25.0, 100.0)
"""Factors on the stated variances of the means, tried where the halves of the poses contradict these."""
NOISE_BLAMED = 10.8
"""Twice the log-likelihood that another noise of the means must gain: p = 1e-3 of χ² with one degree of freedom."""
CONTRADICTED = 0.5e-3
"""p-value of either side at which halves of poses contradict their stated errors: false in 1e-3 of sessions."""


@dataclass(frozen=True, eq=False)
class BiasReadings:
    """Biases of one sensor, two means per pose or more, in the order of time.

    ``values``, ``sigma`` (axes, n) the means and their standard errors; ``time_s`` (n,) their middles, ``length_s``
    (n,) the duration of each, ``pose`` (n,) number of the pose; ``design`` (n, p) columns of the mean, the constant
    first; ``direction`` (n, k) components of k independent walks in each: ones (n, 1) for the axes of a gyro, the
    vertical (n, 3) for the norm of specific force.
    """

    values: FloatArray
    sigma: FloatArray
    time_s: FloatArray
    length_s: FloatArray
    pose: npt.NDArray[np.int64]
    design: FloatArray
    direction: FloatArray


def unit_kernels(r: BiasReadings) -> tuple[FloatArray, FloatArray, float, float]:
    """``(W, D, walk, drift)``: kernels (n, n) of unit mean square about the mean, and their divisors."""
    span = max(float(r.time_s[-1] - r.time_s[0]), 1e-9)
    t = (r.time_s - r.time_s[0]) / span
    low, high = np.minimum.outer(t, t), np.maximum.outer(t, t)
    along = r.direction @ r.direction.T
    out, sizes = [], []
    for k, kernel in enumerate((low, low**2 * (3.0 * high - low) / 6.0 + INITIAL_SLOPE * np.outer(t, t))):
        size = max(float(np.mean(np.diag(kernel)) - kernel.mean()), 1e-12)
        if k == 0:
            # The mean over an interval of a walk has less variance than its middle, by a sixth of that gained in it.
            kernel = kernel - np.diag(r.length_s / span / 6.0)
        out.append(along * kernel / size)
        sizes.append(size)
    return out[0], out[1], sizes[0], sizes[1]


@dataclass(frozen=True, eq=False)
class Grams:
    """Whitened products of readings and design for every grid point of the strengths: (axes, g), (axes, g, c, c)."""

    sigmas: FloatArray
    log_det: FloatArray
    gram: FloatArray

    def log_likelihood(self, keep: list[int], *, restricted: bool) -> FloatArray:
        """(axes, g) log-likelihood with the columns ``keep`` in the mean, restricted (REML) or not."""
        yy = self.gram[..., 0, 0]
        scaled, scale, side = self._normal(keep)
        half = np.linalg.cholesky(scaled)
        inner = np.linalg.solve(half, (side / scale)[..., None])[..., 0]
        rest = np.maximum(yy - (inner**2).sum(axis=-1), 1e-300)
        out = -0.5 * (self.log_det + rest)
        if restricted:
            out = out - np.log(np.einsum("...ii->...i", half)).sum(axis=-1) - np.log(scale).sum(axis=-1)
        return np.asarray(out)

    def _normal(self, keep: list[int]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Normal matrix of the columns ``keep``, its diagonal scaled to 1, those scales, and the right-hand side."""
        index = [k + 1 for k in keep]
        A = self.gram[..., index, :][..., index]
        scale = np.sqrt(np.maximum(np.einsum("...ii->...i", A), 1e-300))
        scaled = A / (scale[..., :, None] * scale[..., None, :])
        scaled[..., range(len(index)), range(len(index))] += 1e-12
        return scaled, scale, self.gram[..., index, 0]

    def estimates(self, keep: list[int]) -> tuple[FloatArray, FloatArray]:
        """Generalised least squares: (axes, g, k) coefficients and (axes, g, k, k) covariances."""
        scaled, scale, side = self._normal(keep)
        inverse = np.linalg.inv(scaled) / (scale[..., :, None] * scale[..., None, :])
        theta = (inverse @ side[..., None])[..., 0]
        return theta, inverse


@dataclass(frozen=True, eq=False)
class BiasProcess:
    """The likelihood of biases under every mixture of scatter, walk and drift.

    ``axis_factor`` (axes,) are sizes of the axes relative to each other, ``noise_factor`` multiplies the stated
    variances of the means.
    """

    readings: BiasReadings
    axis_factor: FloatArray
    noise_factor: float = 1.0

    @staticmethod
    def of(readings: BiasReadings) -> BiasProcess:
        """The process with relative sizes of the axes and the noise of the means estimated from the readings."""
        process = BiasProcess(readings, np.ones(len(readings.values)))
        contradicted = process.halves_contradict()
        if contradicted:
            columns = list(range(readings.design.shape[1]))
            factors = (1.0, *(f for f in NOISE_FACTORS if (f - 1.0) * contradicted > 0.0))
            tried = [replace(process, noise_factor=f) for f in factors]
            tops = [p.maximum((SCATTER, WALK, DRIFT), columns, restricted=True)[0] for p in tried]
            k = int(np.argmax(tops))
            # A walk within poses makes halves differ too: the noise is changed only where clearly likelier (1e-3).
            if 2.0 * (tops[k] - tops[0]) > NOISE_BLAMED:
                process = tried[k]
        return process._with_axis_factors()

    def halves_contradict(self) -> int:
        """1 or -1 where the two halves of poses differ by more, or less, than their stated errors (two-sided, 1e-3)."""
        r = self.readings
        pair = np.flatnonzero(np.diff(r.pose) == 0)
        away = (r.values[:, pair + 1] - r.values[:, pair]) ** 2 / (r.sigma[:, pair + 1] ** 2 + r.sigma[:, pair] ** 2)
        dof = float(away.size)
        if dof < 1.0:
            return 0
        p = float(chdtrc(dof, float(away.sum())))
        return int(p < CONTRADICTED) - int(1.0 - p < CONTRADICTED)

    def _with_axis_factors(self) -> BiasProcess:
        """The process with sizes of the axes relative to each other, where equal ones are clearly refuted.

        Three axes together determine a strength better than each alone: with freely fitted factors the uncertainties of
        coefficients were 25 % too small under a walk, with this limit 2 %.
        """
        if len(self.axis_factor) == 1:
            return self
        columns = list(range(self.readings.design.shape[1]))
        equal = self.grid.log_likelihood(columns, restricted=True)
        best = self.grid.sigmas[int(equal.sum(axis=0).argmax())]
        if not best.any():
            return self
        each = self.grams(np.array(AXIS_FACTORS)[:, None] * best).log_likelihood(columns, restricted=True)
        gain = 2.0 * float((each.max(axis=1) - each[:, AXIS_FACTORS.index(1.0)]).sum())
        if gain <= UNEQUAL_AXES:
            return self
        weight = np.exp(each - each.max(axis=1, keepdims=True))
        factors = np.exp((weight * np.log(AXIS_FACTORS)).sum(axis=1) / weight.sum(axis=1))
        return replace(self, axis_factor=factors / np.sqrt(np.mean(factors**2)))

    @cached_property
    def sizes(self) -> tuple[float, float]:
        """Divisors of walk and drift."""
        return unit_kernels(self.readings)[2:]

    @cached_property
    def levels(self) -> FloatArray:
        """(LEVELS + 1,) σ of the grid: 0, then from a fifth of the means' error to twice the total scatter."""
        r = self.readings
        own = float(np.median(r.sigma)) * np.sqrt(self.noise_factor)
        spread = float(np.sqrt(np.mean((r.values - np.median(r.values, axis=1, keepdims=True)) ** 2)))
        top = max(2.0 * spread, 3.0 * own)
        low = max(min(0.2 * own, 0.05 * top), 1e-3 * top)
        return np.concatenate([[0.0], np.geomspace(low, top, LEVELS)])

    @cached_property
    def grid(self) -> Grams:
        """The whole grid."""
        x = self.levels
        return self.grams(np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3))

    def grams(self, sigmas: FloatArray) -> Grams:
        """Whitened products at every row of ``sigmas`` (g, 3): scatter, walk, drift."""
        r = self.readings
        span = max(float(r.time_s[-1] - r.time_s[0]), 1e-9)
        t = (r.time_s - r.time_s[0]) / span
        walk, drift = self.sizes
        log_det, gram = [], []
        for values, sigma, factor in zip(r.values, r.sigma, self.axis_factor, strict=True):
            s, w, d = (factor * sigmas.T) ** 2
            strengths = np.stack(
                [s, w / walk, d / drift, INITIAL_SLOPE * d / drift, np.full(len(s), self.noise_factor)], axis=1
            )
            one = _core.bias_process_grams(
                np.column_stack([values, r.design]), sigma**2, t, r.length_s / span, r.pose, r.direction, strengths
            )
            log_det.append(one[0])
            gram.append(one[1])
        return Grams(sigmas, np.array(log_det), np.array(gram))

    def maximum(self, free: tuple[int, ...], keep: list[int], *, restricted: bool) -> tuple[float, FloatArray]:
        """Largest log-likelihood with the strengths ``free`` (the others 0), and the strengths (3,) there."""
        held = [k for k in range(3) if k not in free]
        rows = np.flatnonzero((self.grid.sigmas[:, held] == 0.0).all(axis=1))
        part = Grams(self.grid.sigmas[rows], self.grid.log_det[:, rows], self.grid.gram[:, rows])
        value = part.log_likelihood(keep, restricted=restricted).sum(axis=0)
        k = int(value.argmax())
        top, best = float(value[k]), part.sigmas[k]
        for factor in POLISH:
            axes = [
                np.array([0.0, self.levels[1]]) if best[j] == 0.0 and j in free
                else best[j] * np.array([1.0 / factor, 1.0, factor]) if j in free else np.zeros(1)
                for j in range(3)
            ]  # fmt: skip
            around = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
            value = self.grams(around).log_likelihood(keep, restricted=restricted).sum(axis=0)
            k = int(value.argmax())
            if value[k] > top:
                top, best = float(value[k]), around[k]
        return top, best

    def mixture(self, keep: list[int]) -> tuple[FloatArray, FloatArray]:
        """Coefficients (axes, k) and covariances (axes, k, k) averaged over the strengths by their likelihood (R.8).

        The prior is flat in log σ from the lowest level to the highest, with the weight of one level at 0.
        """
        part, prior = self._around_best(keep)
        value = part.log_likelihood(keep, restricted=True).sum(axis=0)
        weight = np.exp(value - value.max()) * prior
        weight /= weight.sum()
        theta, covariance = part.estimates(keep)
        mean = np.einsum("g,agk->ak", weight, theta)
        away = theta - mean[:, None, :]
        spread = np.einsum("g,agkl->akl", weight, covariance + away[..., :, None] * away[..., None, :])
        return mean, spread

    def _around_best(self, keep: list[int]) -> tuple[Grams, FloatArray]:
        """A fine grid around the maximum of the likelihood, and the prior weight (g,) of its points."""
        _, best = self.maximum((0, 1, 2), keep, restricted=True)
        one_level = float(np.log(self.levels[2] / self.levels[1]))
        axes, weights = [], []
        for j in range(3):
            levels = self.levels[1:] if best[j] == 0.0 else best[j] * np.array(AROUND)
            axes.append(np.concatenate([[0.0], levels]))
            weights.append(np.concatenate([[one_level], np.gradient(np.log(levels))]))
        sigmas = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        prior = np.einsum("i,j,k->ijk", *weights).ravel()
        return self.grams(sigmas), prior
