"""Spectral ordinates of a static log: cosine transforms of its stretches, in which noise terms are uncorrelated.

The discrete cosine transform (type II) of the block means of a stretch diagonalises the covariance of white noise and
of a random walk from an unknown level *exactly* (docs/noise.md, eq. 9): the likelihood of these two is exact, that of
the others nearly so. A long stretch has two bands: block means of its whole length for low frequencies, segments of
the readings for high ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from trihedron.arrays import TINY, FloatArray, IntArray
from trihedron.errors import InputError
from trihedron.estimate.noise.gaps import (
    MOST_BRIDGED,
    MOST_SLOW,
    SCATTERED_BLOCK,
    Run,
    block_means,
    filled,
    scattered_loss,
    slow_over_fast,
)
from trihedron.transforms import cosine_transform

if TYPE_CHECKING:
    from trihedron.estimate.noise.slow_changes import SlowChange

SYMBOLS = ("Q", "N", "B", "K")
"""Order of the terms in every basis; the ramp R is a deterministic line and has no density."""


def continuous_densities(frequency_hz: FloatArray, rate_hz: float) -> FloatArray:
    """Two-sided density (4, k) of Q, N, B, K = 1 far below the sample rate (docs/noise.md, section 3)."""
    omega = 2.0 * np.pi * frequency_hz
    return np.stack([omega**2 / rate_hz, np.ones_like(omega), 1.0 / omega, 1.0 / omega**2])


def gauss_markov_density(frequency_hz: FloatArray, step_s: float, correlation_time_s: float) -> FloatArray:
    """Two-sided density of a Gauss-Markov process of unit variance, sampled in steps of ``step_s``."""
    ratio = step_s / correlation_time_s
    decay = math.exp(-ratio)
    # 1 - 2 d cos + d² loses its digits for time constants and periods of a million steps.
    denominator = math.expm1(-ratio) ** 2 + 4.0 * decay * np.sin(np.pi * frequency_hz * step_s) ** 2
    return np.asarray(-step_s * math.expm1(-2.0 * ratio) / denominator)


LONGEST_TRANSFORM = 1 << 17
"""Longest transform; a longer stretch is first averaged to block means."""
SEGMENT = 1 << 14
MOST_SEGMENTS = 64
"""Segments used for the high band of one log: a million readings determine white noise to 0.07 %."""
USED_SHARE = 8
"""The lowest 1/8 of the spectrum of block means is used: aliasing by the averaging is below 1 % there."""


@dataclass(frozen=True, eq=False)
class Ordinates:
    """Squared coefficients of one band, times the step: two-sided densities.

    ``frequency_hz``, ``power``, ``count`` (k,): frequency, mean over segments, number of segments; ``columns`` (c, k)
    the coefficients of a line of slope 1/s and of what slow changes may leave, ``cross`` (c, k) the mean products with
    them; ``length`` readings or means of ``block`` readings in ``step_s`` steps per transform; ``order`` (k,) the index
    of the coefficient.
    With scattered missing readings ``kept`` is the remaining fraction of the power, and ``sampling`` the factor with
    which the variance of readings inside a mean, or the transform, is added to every ordinate (eq. 16).
    """

    frequency_hz: FloatArray
    power: FloatArray
    count: FloatArray
    cross: FloatArray
    columns: FloatArray
    order: IntArray
    length: int
    step_s: float
    block: int
    kept: float = 1.0
    sampling: float = 0.0

    @property
    def corner_floor(self) -> float:
        """White floor for Q = 1 by the unpaired first and last phase of a transform."""
        return 4.0 / (self.length * self.step_s)

    @cached_property
    def basis(self) -> FloatArray:
        """(4, k) expected power for Q = N = B = K = 1 (docs/noise.md, eq. 9, 16)."""
        out = unit_densities(self.frequency_hz, self.order, self.length, self.step_s, self.block)
        if self.sampling == 0.0:
            return out
        # Variances of a reading within a mean or a transform, from the same densities at the step of readings.
        step_s = self.step_s / self.block
        length = self.length if self.block == 1 else 64 * self.block
        order = np.arange(1 if self.block == 1 else 64, length)
        within = unit_densities(order / (2.0 * length * step_s), order, length, step_s, 1).sum(axis=1) / length
        return np.asarray(self.kept * out + self.sampling * within[:, np.newaxis])


def unit_densities(frequency_hz: FloatArray, order: IntArray, length: int, step_s: float, block: int) -> FloatArray:
    """(4, k) expected power of ordinates for Q = N = B = K = 1 without missing readings (docs/noise.md, eq. 9)."""
    h = step_s
    eigenvalue = 4.0 * np.sin(np.pi * frequency_hz * h) ** 2
    corners = 4.0 / (length * h) * np.cos(np.pi * order / (2.0 * length)) ** 2
    return np.stack(
        [
            eigenvalue / h + corners,
            np.ones_like(eigenvalue),
            h / np.sqrt(eigenvalue) * flicker_leakage(order),
            h**2 * (1.0 / eigenvalue - (1.0 - 1.0 / block**2) / 6.0),
        ]
    )


def ordinates(
    x: FloatArray,
    rate_hz: float,
    stretches: Sequence[tuple[int, int]],
    changes: Sequence[SlowChange] = (),
    head: tuple[FloatArray, float] | None = None,
) -> list[Ordinates]:
    """Bands of all stretches ``[start, stop)`` of one channel ``x`` (n,), with columns for its slow ``changes``; NaN
    marks a missing reading. Where ``x`` are means, ``head`` are the first readings (k,) and their rate.

    Raises ``InputError`` when no stretch is long enough for a spectrum.
    """
    fast, fast_hz = (x, rate_hz) if head is None else head
    parts = stretches if head is None else [(0, len(fast))]
    total = sum(stop - start for start, stop in stretches)
    length = max(-(-total // LONGEST_TRANSFORM), 1)
    used = USED_SHARE
    if scattered_loss(x) > MOST_BRIDGED:
        length = max(length, SCATTERED_BLOCK)
        # With losses, slow noise masks fast noise: only the means are used, up to half their ordinates.
        used = 2 if slow_over_fast(x) > MOST_SLOW else USED_SHARE
    bands, step_s = list[Ordinates](), length / rate_hz
    block = round(step_s * fast_hz)
    for start, stop in stretches:
        runs, slow = block_means(x[start:stop], length), (start / rate_hz, changes)
        bands += [_whole(run, step_s, block, slow, used) for run in runs if len(run.means) >= 32]
    if block > 1 and used == USED_SHARE:
        bands += _segments(fast, fast_hz, parts, block, _n_columns(changes))
    if not bands:
        raise InputError(
            f"no stretch of the log is long enough to separate noise terms: the longest has "
            f"{max((b - a for a, b in stretches), default=0)} readings; record longer or exclude less"
        )
    return bands


def spread_of_mean(even: float) -> float:
    """Relative standard error of a mean power over the pieces of a log of this evenness."""
    return math.sqrt((1.0 / even - 1.0) / PIECES)


PIECES = 64


def evenness(x: FloatArray) -> tuple[float, float]:
    """Share of the degrees of freedom of ``x`` (n,) that a level of noise which changes along the log leaves: (mean s)²
    over mean s², s the powers of the differences of readings in pieces, without their own scatter; and the level of the
    loudest piece over that of the quietest."""
    length = len(x) // PIECES
    step = np.diff(x[: length * PIECES].reshape(PIECES, length), axis=1) ** 2
    count = np.isfinite(step).sum(axis=1)
    full = count >= max(length // 2, 2)
    power = np.nansum(step[full], axis=1) / count[full]
    if not np.any(power > 0.0):
        return 1.0, 1.0
    # Squared differences of white noise are correlated: their mean has 2/3 of a degree of freedom each.
    excess = float(np.var(power) / np.mean(power) ** 2 - np.mean(3.0 / count[full]))
    return 1.0 / (1.0 + max(excess, 0.0)), math.sqrt(float(power.max()) / max(float(power.min()), TINY))


def _whole(
    run: Run, step_s: float, block: int, slow: tuple[float, Sequence[SlowChange]], used: int = USED_SHARE
) -> Ordinates:
    """Band of a run; ``slow``: the start [s] of its stretch, and the changes of the log."""
    means, (start_s, changes) = run.means, slow
    n = len(means)
    last = n - 1 if block == 1 else n // used
    order = np.arange(1, last + 1)
    coefficient = cosine_transform(means - means.mean())[1 : last + 1]
    # Bridged means contain no white noise: the power is scaled up.
    coefficient /= np.sqrt(1.0 - run.bridged)
    time_s = np.asarray(start_s + (run.first + np.arange(n) + 0.5) * step_s, dtype=np.float64)
    rest = [cosine_transform(change.columns(time_s))[:, 1 : last + 1] for change in changes]
    columns = np.vstack([line_coefficients(n, order) * step_s, *rest]) * np.sqrt(step_s)
    return Ordinates(
        frequency_hz=order / (2.0 * n * step_s),
        power=coefficient**2 * step_s,
        count=np.ones(last),
        cross=coefficient * np.sqrt(step_s) * columns,
        columns=columns,
        order=order,
        length=n,
        step_s=step_s,
        block=block,
        sampling=run.sampling * block,
    )


def _segments(
    x: FloatArray, rate_hz: float, stretches: Sequence[tuple[int, int]], block: int, n_columns: int
) -> list[Ordinates]:
    """Band above those of means of ``block`` readings; there slow changes leave nothing in their columns."""
    # The band begins where the used eighth of the block means ends, at ordinate 16 of a segment.
    length = max(SEGMENT, 1 << (128 * block - 1).bit_length())
    total = max((stop - start for start, stop in stretches), default=0)
    while length > total and length > 256 * USED_SHARE:
        length //= 2
    starts = np.array([s for a, b in stretches for s in range(a, b - length + 1, length)])
    if len(starts) == 0:
        return []
    if len(starts) > MOST_SEGMENTS:
        starts = starts[np.linspace(0, len(starts) - 1, MOST_SEGMENTS).astype(int)]
    parts, present = filled(np.stack([x[s : s + length] for s in starts]))
    if len(parts) == 0:
        return []
    step_s = 1.0 / rate_hz
    coefficient = cosine_transform(parts)
    lowest = length // (USED_SHARE * block) + 1
    order = np.arange(lowest, length)
    coefficient = coefficient[:, lowest:]
    columns = np.zeros((n_columns, len(order)))
    columns[0] = line_coefficients(length, order) * step_s * np.sqrt(step_s)
    return [
        Ordinates(
            frequency_hz=order / (2.0 * length * step_s),
            power=np.mean(coefficient**2, axis=0) * step_s,
            count=np.full(len(order), float(len(parts))),
            cross=coefficient.mean(axis=0) * np.sqrt(step_s) * columns,
            columns=columns,
            order=order,
            length=length,
            step_s=step_s,
            block=1,
            kept=float(np.mean(present**2)),
            sampling=float(np.mean(present * (1.0 - present))),
        )
    ]


def _n_columns(changes: Sequence[SlowChange]) -> int:
    return 1 + sum(2 * len(change.weights) for change in changes)


def line_coefficients(n: int, order: IntArray) -> FloatArray:
    """Orthonormal cosine coefficients of 0, 1, 2 … n−1 (order 1 and up): zero for even orders."""
    half = np.pi * order / (2.0 * n)
    return np.asarray(np.where(order % 2 == 1, -np.sqrt(2.0 / n) * np.cos(half) / (2.0 * np.sin(half) ** 2), 0.0))


# End effects of a cosine transform on 1/f noise.

_ORDERS = 32


@lru_cache(maxsize=1)
def _table() -> FloatArray:
    """Expected squared cosine coefficient of 1/f noise over the density at its frequency, orders 1 to 32."""
    n, pad = 512, 1 << 14
    k = np.arange(n)
    omega = 2.0 * np.pi * np.arange(1, pad // 2) / pad
    order = np.arange(1, _ORDERS + 1)
    shape = math.sqrt(2.0 / n) * np.cos(np.pi * order[:, np.newaxis] * (2 * k + 1) / (2 * n))
    gain = np.abs(np.fft.rfft(shape, pad, axis=1)[:, 1 : pad // 2]) ** 2
    power = 2.0 * np.sum(gain * (0.5 / np.sin(omega / 2.0)), axis=1) / pad
    return np.asarray(power * 2.0 * np.sin(np.pi * order / (2 * n)))


def flicker_leakage(order: IntArray) -> FloatArray:
    """Factor by which end effects change the expected power of 1/f noise at the lowest orders: 0.77, 0.90, 0.93 … 1."""
    table = _table()
    out = np.ones(len(order))
    low = order <= _ORDERS
    out[low] = table[order[low] - 1]
    return out
