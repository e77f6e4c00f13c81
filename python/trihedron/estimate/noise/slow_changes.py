"""Slow changes of a static log that are not noise: the warm-up of a bias, a wave, what the temperature explains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from trihedron.arrays import TINY, BoolArray, FloatArray
from trihedron.session.drift import LEAST_SWING_K

MEANS = 256
"""Number of means of equal length in which slow changes are sought."""
MEANS_OF_HEAT = 64
"""Number of means that are compared with the temperature: their noise is hardly white."""
HELD = 0.5
"""Least share of them with readings."""
CORRELATION = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""Correlation times, in means, of the Gaussian processes beside white noise; a walk and flicker are tried too."""
STRENGTHS = np.concatenate([[0.0], np.geomspace(1e-3, 1e4, 29)])
"""Their variances, in units of the white variance of a mean."""
WALK = slice(1)
"""The random walk among the processes."""
TIMES = np.geomspace(0.005, 0.5, 15)
"""Time constants that are tried, in lengths of the log: a slower warm-up is like a straight line or a walk."""
CYCLES = np.arange(1.5, 16.1, 0.125)
"""Periods in the log that are tried: less than one and a half is drift, more is a line of the spectrum."""
MOST = 4
"""Most changes of one log: sums of more exponentials cannot be told apart."""
PLAUSIBLE = float(np.log(MEANS))
"""Least rise of twice the log-likelihood per parameter (size and time of an exponential; amplitude, phase and period of
a wave) of a change for which intervals allow: with more it is as likely as none (Schwarz)."""
EARNED = 10.0
"""Least rise per parameter of a change that is stated and subtracted."""
MOSTLY = 0.5
"""Share of a random walk's power beyond which temperature, not noise, is the larger part of it. Of 6000 axes of white
noise, flicker, walk or ramp beside an independent temperature (walk, cycle or cooling) none reaches 0.41."""


@dataclass(frozen=True)
class SlowChange:
    """A change by ``weights`` of exp(-t/``time_s``), or of cosine and sine of period ``time_s``; ``rise`` is the
    rise of twice the log-likelihood per parameter above noise and the other changes."""

    time_s: float
    weights: tuple[float, ...]
    rise: float

    @property
    def is_wave(self) -> bool:
        """Whether it is periodic."""
        return len(self.weights) > 1

    @property
    def is_certain(self) -> bool:
        """Whether it is stated and subtracted."""
        return self.rise > EARNED

    @property
    def size(self) -> float:
        """Amplitude."""
        return float(np.linalg.norm(self.weights))

    def at(self, t: FloatArray) -> FloatArray:
        """(n,) its value at times (n,) [s] after the first reading."""
        return np.asarray(self.weights @ _shape(t / self.time_s, is_wave=self.is_wave))

    def columns(self, t: FloatArray) -> FloatArray:
        """(2 or 4, n) what an error of its weights and of its time adds at times (n,) [s]."""
        shape, late = _shape(t / self.time_s, is_wave=self.is_wave), t / self.time_s
        return np.vstack([shape, late * shape])


def _shape(phase: FloatArray, *, is_wave: bool) -> FloatArray:
    """(1, n) exponential, or (2, n) cosine and sine, at ``phase`` (n,), time over its time."""
    if is_wave:
        return np.stack([np.cos(2.0 * np.pi * phase), np.sin(2.0 * np.pi * phase)])
    return np.exp(-phase)[np.newaxis]


def _solved(gram: FloatArray, along: FloatArray) -> FloatArray:
    """(s, c) solutions of normal equations (s, c, c) with right sides (s, c); two columns may be the same."""
    place = np.arange(gram.shape[-1])
    gram[:, place, place] *= 1.0 + 1e-12
    return np.asarray(np.linalg.solve(gram, along[..., np.newaxis])[..., 0])


def slow_changes(x: FloatArray, rate_hz: float, breaks: Sequence[float] = ()) -> list[SlowChange]:
    """Exponentials and waves in readings ``x`` (n,), NaN where missing, that no Gaussian noise explains as well, beside
    a straight line and a level on each side of the ``breaks`` (numbers of readings).

    They are added one by one, each time the one that raises the likelihood most, with all their times fitted anew.
    """
    means = block_means(x)
    if means is None:
        return []
    base = means.line_and_levels(breaks)
    times: list[tuple[float, bool]] = []
    best, found = means.fitted(base), []
    while len(times) < MOST:
        tried = []
        for is_wave, grid in ((False, TIMES), (True, 1.0 / CYCLES)):
            likelihood, time = means.scanned(means.with_shapes(base, times), grid, is_wave=is_wave)
            # Beside a change whose time is wrong the next one may show little.
            if times or 2.0 * (likelihood - best[0]) > PLAUSIBLE:
                more = means.refined(base, [*times, (time, is_wave)])
                fit = means.fitted(means.with_shapes(base, more))
                tried.append((2.0 * (fit[0] - best[0]) / (2 + is_wave), fit, more))
        rise, fit, more = max(tried, key=lambda one: one[0], default=(0.0, best, times))
        if rise <= PLAUSIBLE:
            break
        best, times = fit, more
        found.append(rise)
    duration_s, left, out = means.length / rate_hz, best[1][base.shape[1] :], []
    for (time, is_wave), rise in zip(times, found, strict=True):
        own, left = left[: 1 + is_wave], left[1 + is_wave :]
        out.append(SlowChange(time * duration_s, tuple(own.tolist()), rise))
    return out


def choices_of(changes: Sequence[SlowChange]) -> list[Sequence[SlowChange]]:
    """The changes that are certain and, where there are others, which are as likely as not, all of them."""
    certain = [change for change in changes if change.is_certain]
    return [certain] if len(certain) == len(changes) else [certain, changes]


@dataclass(frozen=True, eq=False)
class Means:
    """Means ``y`` (k,) of those equal parts of ``length`` readings that are ``held`` (n,)."""

    y: FloatArray
    held: BoolArray
    length: int

    @cached_property
    def t(self) -> FloatArray:
        """(k,) their times as fractions of the length."""
        return (np.flatnonzero(self.held) + 0.5) / len(self.held)

    def shape(self, time: float, *, is_wave: bool) -> FloatArray:
        """(k, 1 or 2) means of an exponential or a wave of ``time`` lengths."""
        half = 0.5 / (len(self.held) * time)
        # The mean of a curve over a part is not its middle.
        mean = np.sinc(2.0 * half) if is_wave else np.sinh(half) / half
        return mean * _shape(self.t / time, is_wave=is_wave).T

    def with_shapes(self, base: FloatArray, times: Sequence[tuple[float, bool]]) -> FloatArray:
        """(k, c) the columns ``base`` and those of ``times``."""
        return np.column_stack([base, *(self.shape(time, is_wave=is_wave) for time, is_wave in times)])

    def line_and_levels(self, breaks: npt.ArrayLike) -> FloatArray:
        """(k, c) a straight line and the levels after the ``breaks`` (numbers of readings) against the first."""
        level = np.searchsorted(np.sort(breaks), self.t * self.length)
        return np.column_stack([self.t, level[:, np.newaxis] == np.unique(level)[1:]])

    def fitted(self, columns: FloatArray, processes: slice = slice(None)) -> tuple[float, FloatArray]:
        """Log-likelihood beside the most likely noise, the mean free, and the weights of ``columns`` (k, c) there."""
        best, weights = -np.inf, np.zeros(columns.shape[1])
        for process in gaussian_processes(self.held.tobytes())[processes]:
            likelihood, solved = self.beside(columns, process)
            k = int(np.argmax(likelihood))
            if likelihood[k] > best:
                best, weights = float(likelihood[k]), solved[k]
        return best, weights

    def beside(self, columns: FloatArray, process: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Log-likelihood (s,) and weights (s, c) of ``columns`` (k, c) beside white noise and each strength of a
        ``process``, their scale free."""
        power, across = process
        y, X, dof = across @ self.y, across @ columns, len(self.y) - 1
        variance = 1.0 + STRENGTHS[:, np.newaxis] * power
        weighted = X.T / variance[:, np.newaxis]
        along = weighted @ y
        solved = _solved(weighted @ X, along)
        left = np.maximum((y**2 / variance).sum(axis=1) - (along * solved).sum(axis=1), TINY)
        deviance = np.log(variance).sum(axis=1) + dof * (np.log(2.0 * np.pi * left / dof) + 1.0)
        return np.asarray(-0.5 * deviance), np.asarray(solved)

    def scanned(self, columns: FloatArray, times: FloatArray, *, is_wave: bool) -> tuple[float, float]:
        """Log-likelihood of the best shape of ``times`` (m,) beside ``columns`` (k, c), in white noise and a random
        walk, and its time."""
        power, across = gaussian_processes(self.held.tobytes())[0]
        shapes = across @ np.stack([self.shape(time, is_wave=is_wave) for time in times])
        rest = across @ np.column_stack([self.y, columns])
        best, dof = (-np.inf, 0.0), len(self.y) - 1
        for strength in STRENGTHS:
            variance = 1.0 + strength * power
            sigma = np.sqrt(variance)[:, np.newaxis]
            y, X, (known, _) = rest[:, 0] / sigma[:, 0], shapes / sigma, np.linalg.qr(rest[:, 1:] / sigma)
            y, X = y - known @ (known.T @ y), X - known @ (known.T @ X)
            along = y @ X
            gain = (along * _solved(X.swapaxes(1, 2) @ X, along)).sum(axis=1)
            k = int(np.argmax(gain))
            left = max(float(y @ y - gain[k]), TINY)
            deviance = float(np.log(variance).sum()) + dof * (float(np.log(2.0 * np.pi * left / dof)) + 1.0)
            best = max(best, (-0.5 * deviance, float(times[k])))
        return best

    def refined(self, base: FloatArray, times: Sequence[tuple[float, bool]]) -> list[tuple[float, bool]]:
        """Times of the largest likelihood in white noise and a random walk, near the given ones."""
        # Imported here: commands that read a log start faster.
        from scipy.optimize import Bounds, minimize

        kinds = [is_wave for _, is_wave in times]
        start = np.log([time for time, _ in times])
        least = np.log(np.where(kinds, 1.0 / CYCLES[-1], TIMES[0])) - 0.1
        most = np.log(np.where(kinds, 1.0 / CYCLES[0], TIMES[-1])) + 0.1

        def misfit(logs: FloatArray) -> float:
            return -self.fitted(self.with_shapes(base, list(zip(np.exp(logs), kinds, strict=True))), WALK)[0]

        # Steps as those between the times that are tried.
        start, step = start.clip(least, most), np.where(kinds, 0.01, 0.3)
        simplex = np.vstack([start, start + np.diag(np.where(start + step < most, step, -step))])
        best = minimize(
            misfit,
            start,
            method="Nelder-Mead",
            bounds=Bounds(least, most),
            options={"initial_simplex": simplex, "xatol": 1e-4, "fatol": 1e-2},
        )
        return list(zip(np.exp(best.x).tolist(), kinds, strict=True))


@lru_cache(maxsize=8)
def gaussian_processes(held: bytes) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """Of a random walk, flicker and Gauss-Markov noise in the means that are ``held``: variances and directions (rows)
    of independent parts, orthogonal to the mean."""
    there = np.frombuffer(held, dtype=bool)
    contrasts = np.linalg.svd(np.ones((1, int(there.sum()))))[2][1:]
    found = []
    for covariance in _covariances(len(there)):
        power, vectors = np.linalg.eigh(contrasts @ covariance[np.ix_(there, there)] @ contrasts.T)
        found.append((np.maximum(power, 0.0), vectors.T @ contrasts))
    return tuple(found)


def _covariances(n: int) -> Iterator[FloatArray]:
    index = np.arange(n)
    yield np.minimum.outer(index, index) + 0.5
    # 1/f noise by Kasdin's filter: fractional integration of order one half.
    taps = np.cumprod(np.concatenate([[1.0], (np.arange(1, n) - 0.5) / np.arange(1, n)]))
    filtered = np.array([np.concatenate([taps[: i + 1][::-1], np.zeros(n - i - 1)]) for i in index])
    yield filtered @ filtered.T
    for time in CORRELATION:
        yield np.exp(-np.abs(np.subtract.outer(index, index)) / time)


def share_of_temperature(x: FloatArray, temperature: FloatArray, breaks: Sequence[float] = ()) -> float:
    """Share of the power of slow changes of readings ``x`` (n,) that ``temperature`` (n,) explains, beside a straight
    line and a level on each side of the ``breaks`` (numbers of readings); 0 where the temperature does not change."""
    there = np.flatnonzero(np.isfinite(x))
    inside = slice(there[0], there[-1] + 1) if len(there) else slice(0)
    means = block_means(x[inside], MEANS_OF_HEAT)
    if means is None:
        return 0.0
    heat = temperature[inside][: means.length].reshape(MEANS_OF_HEAT, -1).mean(axis=1)[means.held]
    swing = float(np.ptp(heat))
    if swing < LEAST_SWING_K:
        return 0.0
    u, base = (heat - heat.mean()) / swing, means.line_and_levels(np.asarray(breaks) - inside.start)
    columns = np.column_stack([base, u, u**2, u**3])
    walk = gaussian_processes(means.held.tobytes())[0]
    without, beside = (means.beside(part, walk)[0] for part in (base, columns))
    # In the covariance that is most likely without it, whose whitened readings have the walk's increments.
    k = int(np.argmax(without))
    return 1.0 - float(np.exp(2.0 * (without[k] - beside[k]) / len(means.y)))


def block_means(x: FloatArray, number: int = MEANS) -> Means | None:
    """Means of ``number`` equal parts of readings ``x`` (n,); ``None`` where half of them have too few readings."""
    n = len(x) // number
    if n < 1:
        return None
    blocks = x[: n * number].reshape(number, n)
    count = np.isfinite(blocks).sum(axis=1)
    held = 2 * count >= n
    if np.count_nonzero(held) < HELD * number:
        return None
    return Means(np.nansum(blocks[held], axis=1) / count[held], held, n * number)
