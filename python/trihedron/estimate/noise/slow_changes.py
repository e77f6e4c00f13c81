"""Slow changes of a static log that are not noise: the warm-up of a bias, a wave, what the temperature explains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import TINY, BoolArray, FloatArray
from trihedron.session.drift import LEAST_SWING_K

MEANS = 64
"""Number of means of equal length for all tests: their noise is white noise and a random walk."""
HELD = 0.5
"""Least share of them with readings."""
WALKS = np.concatenate([[0.0], np.geomspace(1e-3, 1e4, 29)])
"""Random walk variances from mean to mean that are tried, in units of the white variance of a mean."""
TIMES = np.geomspace(0.02, 0.5, 15)
"""Time constants that are tried, in lengths of the log: a slower warm-up is like a straight line or a walk."""
NEAR = (TIMES[1] / TIMES[0]) ** np.array([1.0, 1.0 / 7.0, 1.0 / 49.0])
"""Widths of the finer steps about the best of them, each of one step of the one before."""
EARNED = 30.0
"""Least rise of twice the log-likelihood. In noise of known strength it is n log(1 + F/(n - 4)) of n means, F an F(1,
n - 4) variate: over 15 time constants and 30 strengths of a walk chance reaches 30 in 6e-5 of logs (Bonferroni).
Simulated (benches/static_screening.py): 3e-4 at the most, in a walk; flicker and Gauss-Markov noise less."""
MOSTLY = 0.5
"""Share of a random walk's power beyond which temperature, not noise, is the larger part of it. Of 6000 axes of white
noise, flicker, walk or ramp beside an independent temperature (walk, cycle or cooling) none reaches 0.41."""


@dataclass(frozen=True)
class WarmUp:
    """A bias that changes by ``size`` over the log, as 1 - exp(-t/``time_s``); ``rise`` is twice the rise of the
    log-likelihood."""

    size: float
    time_s: float
    rise: float

    def at(self, t: FloatArray) -> FloatArray:
        """(n,) bias relative to its final value, at times (n,) [s] after the first reading."""
        return -self.size * np.exp(-t / self.time_s)


def warm_up(x: FloatArray, rate_hz: float) -> WarmUp | None:
    """The warm-up of readings ``x`` (n,), NaN where missing; ``None`` where a straight line with a random walk and
    white noise of any strength explains them as well."""
    found = block_means(x)
    if found is None:
        return None
    (y, t, _), n = found, len(x) // MEANS
    best, without = _best_time(y, t, TIMES)
    rise = 2.0 * (best[0] - without)
    if rise <= EARNED:
        return None
    # What a time constant that is off by per cents leaves of hundreds of counts is more than flicker: finer steps.
    for width in NEAR:
        best, _ = _best_time(y, t, best[2] * np.geomspace(1.0 / width, width, len(TIMES)))
    _, weight, time = best
    # The mean of the curve over a block is more than its middle.
    half = 0.5 / (MEANS * time)
    return WarmUp(-weight * half / np.sinh(half), time * MEANS * n / rate_hz, rise)


def _best_time(y: FloatArray, t: FloatArray, times: FloatArray) -> tuple[tuple[float, float, float], float]:
    """Log-likelihood, size and time constant of the best of ``times`` for means y at t (n,), and the log-likelihood
    without a warm-up."""
    columns = np.column_stack([y, np.ones_like(t), t, np.exp(-t[:, None] / times)])
    without, tried = [], []
    for white, constant in _whitened(columns, t):
        without.append(constant + _fitted(white[:, :3])[0])
        for k, time in enumerate(times):
            likelihood, weight = _fitted(white[:, [0, 1, 2, 3 + k]])
            tried.append((constant + likelihood, weight, float(time)))
    return max(tried), max(without)


CYCLES = np.arange(1.5, 16.1, 0.125)
"""Periods in the log that are tried: less than one and a half is drift, more is a line of the spectrum."""
EARNED_BY_WAVE = 45.0
"""Least rise of twice the log-likelihood of a wave: n log(1 + 2 F/(n - 4)), F an F(2, n - 4) variate; over 118 periods
and 30 strengths of a walk chance reaches 45 in 2e-6 of logs. Simulated: 3e-6 at the most in white noise, a walk and
Gauss-Markov noise, 1e-4 in flicker, which is none of the noise without a wave that is tried."""


@dataclass(frozen=True)
class Wave:
    """A sinusoid of ``period_s`` with a ``cosine`` and a ``sine`` part; ``rise`` is twice the rise of the
    log-likelihood."""

    period_s: float
    cosine: float
    sine: float
    rise: float

    @property
    def amplitude(self) -> float:
        """Its amplitude."""
        return float(np.hypot(self.cosine, self.sine))

    def at(self, t: FloatArray) -> FloatArray:
        """(n,) its value at times (n,) [s] after the first reading."""
        phase = 2.0 * np.pi / self.period_s * t
        return self.cosine * np.cos(phase) + self.sine * np.sin(phase)


def wave(x: FloatArray, rate_hz: float) -> Wave | None:
    """The wave of few periods in readings ``x`` (n,), NaN where missing; ``None`` where a straight line with a random
    walk and white noise of any strength explains them as well."""
    found = block_means(x)
    if found is None:
        return None
    (y, t, _), n = found, len(x) // MEANS
    phase = 2.0 * np.pi * t[:, None] * CYCLES
    columns = np.column_stack([np.ones_like(t), t, y, np.cos(phase), np.sin(phase)])
    without, tried = [], []
    for white, constant in _whitened(columns, t):
        line = np.linalg.qr(white[:, :2])[0]
        rest, cosine, sine = np.split(white[:, 2:] - line @ (line.T @ white[:, 2:]), [1, 1 + len(CYCLES)], axis=1)
        square = np.stack([(cosine**2).sum(0), (cosine * sine).sum(0), (sine**2).sum(0)])
        along = np.stack([(cosine * rest).sum(0), (sine * rest).sum(0)])
        determinant = square[0] * square[2] - square[1] ** 2
        parts = np.stack([square[2] * along[0] - square[1] * along[1], square[0] * along[1] - square[1] * along[0]])
        parts /= determinant
        k = int(np.argmax((parts * along).sum(0)))
        left = float((rest**2).sum())
        least = max(left - float(parts[:, k] @ along[:, k]), TINY)
        without.append(constant - 0.5 * len(t) * float(np.log(max(left, TINY))))
        tried.append((constant - 0.5 * len(t) * float(np.log(least)), float(CYCLES[k]), *map(float, parts[:, k])))
    best, cycles, cosine_part, sine_part = max(tried)
    rise = 2.0 * (best - max(without))
    return Wave(MEANS * n / rate_hz / cycles, cosine_part, sine_part, rise) if rise > EARNED_BY_WAVE else None


def _whitened(columns: FloatArray, t: FloatArray) -> Iterator[tuple[FloatArray, float]]:
    """Columns (n, c) of means at ``t`` (n,) whitened for each random walk, and the constant of its log-likelihood."""
    for strength in WALKS:
        factor = np.linalg.cholesky(np.eye(len(t)) + strength * (MEANS * np.minimum.outer(t, t)))
        yield np.asarray(np.linalg.solve(factor, columns)), -float(np.sum(np.log(np.diag(factor))))


def _fitted(white: FloatArray) -> tuple[float, float]:
    """Log-likelihood of whitened means (first column) regressed on the other columns, free scale; last coefficient."""
    weight, _, _, _ = np.linalg.lstsq(white[:, 1:], white[:, 0], rcond=None)
    left = float(np.sum((white[:, 0] - white[:, 1:] @ weight) ** 2))
    k = len(white)
    return float(-0.5 * k * np.log(max(left, TINY) / k)), float(weight[-1])


def share_of_temperature(x: FloatArray, temperature: FloatArray, breaks: Sequence[float] = ()) -> float:
    """Share of the power of slow changes of readings ``x`` (n,) that ``temperature`` (n,) explains, beside a straight
    line and a level on each side of the ``breaks`` (numbers of readings); 0 where the temperature does not change."""
    there = np.flatnonzero(np.isfinite(x))
    inside = slice(there[0], there[-1] + 1) if len(there) else slice(0)
    found = block_means(x[inside])
    if found is None:
        return 0.0
    y, t, held = found
    n = len(x[inside]) // MEANS
    heat = temperature[inside][: n * MEANS].reshape(MEANS, n).mean(axis=1)[held]
    swing = float(np.ptp(heat))
    if swing < LEAST_SWING_K:
        return 0.0
    u, side = (heat - heat.mean()) / swing, np.searchsorted(np.sort(breaks), t * n * MEANS + inside.start)
    columns = np.column_stack([y, side[:, None] == np.unique(side), t, u, u**2, u**3])
    fits = []
    for white, constant in _whitened(columns, t):
        without, beside = (_fitted(part)[0] for part in (white[:, :-3], white))
        fits.append((without + constant, beside - without))
    # In the covariance that is most likely without it, whose whitened readings have the walk's increments.
    return 1.0 - float(np.exp(-2.0 * max(fits)[1] / len(t)))


def block_means(x: FloatArray, number: int = MEANS) -> tuple[FloatArray, FloatArray, BoolArray] | None:
    """Means of readings ``x`` (n,), their times as fractions of the log, and which of the ``number`` there are."""
    n = len(x) // number
    if n < 1:
        return None
    blocks = x[: n * number].reshape(number, n)
    count = np.isfinite(blocks).sum(axis=1)
    held = 2 * count >= n
    if np.count_nonzero(held) < HELD * number:
        return None
    return np.nansum(blocks[held], axis=1) / count[held], (np.flatnonzero(held) + 0.5) / number, held
