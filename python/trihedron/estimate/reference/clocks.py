"""Time alignment of a reference and a log by the magnitude of the rate, which does not depend on the axes."""

from dataclasses import dataclass

import numpy as np

from trihedron._core import rolling_mean
from trihedron.arrays import TINY, BoolArray, FloatArray, IntArray
from trihedron.errors import InputError
from trihedron.estimate.reference.together import Grid, Reference

LEAST_CORRELATION = 0.7
"""Least correlation of shared motion: of 7140 pairs of unrelated hand motions of 30 to 60 s one in a thousand reaches
0.70 at its best lag (the median 0.42), shared ones reach 0.93 and more."""
LEAST_OVERLAP = 0.25
"""Least overlap, relative to the shorter of the two."""
BLOCK_S = 8.0
"""Length of the stretches whose lags are estimated: several turns of a hand."""
JUMP_S = 0.05
"""Least change of the lag between stretches that is a jump: lags of stretches scatter by milliseconds."""
LOCKED = 0.9
"""Least correlation of a stretch whose lag is used: unrelated turns of 8 s reach 0.8 at some lag within six seconds."""
FEWEST_BEYOND = 2
"""Fewest stretches on either side of a jump with consistent lags."""
FASTEST = 0.01
"""Largest plausible clock rate: a larger one means that a periodic motion was matched at successive periods."""
SEARCH_S = 6.0
ALIKE = 0.01
"""Peaks with a correlation within this of the best are equivalent: the timestamps then decide."""


@dataclass(frozen=True)
class Alignment:
    """``t_reference = t_log (1 + rate) + offset_s``, and the correlation."""

    offset_s: float
    rate: float
    correlation: float


def align(grid: Grid, reference: Reference, stamped_offset_s: float | None) -> Alignment:
    """Offset and rate of the reference's clock, to about a sample.

    ``stamped_offset_s`` is the offset by the absolute timestamps of both logs, where they have any. Raises
    ``InputError`` when the motions differ at every lag, or the reference's clock jumps.
    """
    ours = _size(grid.gyroscope - np.median(grid.gyroscope[grid.is_valid], axis=0), grid.is_valid)
    first_s, last_s = reference.motion.time_s[[0, -1]].tolist()
    theirs = _reference_size(reference, np.arange(first_s, last_s, grid.step_s), grid.step_s)
    offset, correlation = _best_lag(ours, theirs, grid.step_s, stamped_offset_s)
    offset += first_s - grid.time_s[0]
    # A clock jump reduces the correlation of the whole log: stretches are tested first.
    refined = _refined(ours, grid, reference, offset)
    if correlation < LEAST_CORRELATION:
        raise InputError(
            f"{reference.motion.source}: this reference and the log share no motion (the turning rates agree best "
            f"with a correlation of {correlation:.2f}; shared ones reach 0.93): name the reference of this very log, "
            "or check its rate and angle units."
        )
    return Alignment(*refined, correlation)


def _size(rate: FloatArray, is_there: BoolArray) -> FloatArray:
    """(n,) magnitude of rates (n, 3); NaN where there is none."""
    return np.where(is_there, np.linalg.norm(rate, axis=1), np.nan)


def _reference_size(reference: Reference, t: FloatArray, step: float) -> FloatArray:
    """(n,) magnitude of the reference's rate at times (n,) ``step`` apart; NaN where it has no rows."""
    # The differentiated noise of a tracker exceeds the motion unless it is averaged.
    rate = rolling_mean(reference.rate(t), max(1, round(0.1 / step)))
    return _size(rate, reference.covers(t))


def _best_lag(a: FloatArray, b: FloatArray, step: float, stamped: float | None) -> tuple[float, float]:
    """Lag of b (seconds added to a's time give b's) and the correlation there; the lag nearest to ``stamped`` among
    equivalent ones."""
    keep = max(1, int(np.ceil((len(a) + len(b)) / 2**19)))
    a, b, step = a[::keep], b[::keep], step * keep
    correlation, lag, n = _correlations(a, b)
    enough = n >= LEAST_OVERLAP * min(np.isfinite(a).sum(), np.isfinite(b).sum())
    correlation = np.where(enough, correlation, -1.0)
    best = int(np.argmax(correlation))
    peaks = np.flatnonzero(
        (correlation[1:-1] >= correlation[:-2])
        & (correlation[1:-1] >= correlation[2:])
        & (correlation[1:-1] > correlation[best] - ALIKE)
    )
    peaks = np.unique(np.append(peaks + 1, best))
    apart = np.abs(lag[peaks] - lag[best]) * step > 0.2
    if stamped is not None and np.any(apart):
        best = int(peaks[np.argmin(np.abs(lag[peaks] * step - stamped))])
    return float(lag[best] * step), float(correlation[best])


def _correlations(a: FloatArray, b: FloatArray) -> tuple[FloatArray, IntArray, FloatArray]:
    """Correlation of the overlap at every lag, without missing values; lags of b against a; common samples at each."""
    n = 1 << (len(a) + len(b) - 1).bit_length()
    ma, mb = np.isfinite(a).astype(float), np.isfinite(b).astype(float)
    za, zb = np.where(ma > 0, a - np.nanmean(a), 0.0), np.where(mb > 0, b - np.nanmean(b), 0.0)
    f = {k: np.fft.rfft(v, n) for k, v in (("a", za), ("b", zb), ("ma", ma), ("mb", mb), ("aa", za**2), ("bb", zb**2))}

    def over(x: str, y: str) -> FloatArray:
        # Σ_i x_i y_{i+lag}
        return np.asarray(np.fft.irfft(np.conj(f[x]) * f[y], n), dtype=np.float64)

    count = np.maximum(over("ma", "mb"), 1e-9)
    sa, sb = over("a", "mb"), over("ma", "b")
    covariance = over("a", "b") - sa * sb / count
    va = np.maximum(over("aa", "mb") - sa**2 / count, 1e-12 * np.sum(za**2) + TINY)
    vb = np.maximum(over("ma", "bb") - sb**2 / count, 1e-12 * np.sum(zb**2) + TINY)
    lag = np.arange(n)
    lag = np.asarray(np.where(lag < len(b), lag, lag - n))
    order = np.argsort(lag)
    keep = order[(lag[order] > -len(a)) & (lag[order] < len(b))]
    correlation = covariance / np.sqrt(va * vb)
    return np.asarray(correlation[keep]), np.asarray(lag[keep]), np.asarray(np.round(count[keep]))


def _refined(ours: FloatArray, grid: Grid, reference: Reference, offset: float) -> tuple[float, float]:
    """Offset [s] and rate from the lags of stretches.

    Raises ``InputError`` when neighbouring stretches fit well at lags that no steady clock explains.
    """
    length = round(BLOCK_S / grid.step_s)
    lags, middles = [], []
    fits: list[FloatArray] = []
    spread = np.nanstd(ours)
    search = round(SEARCH_S / grid.step_s)
    for start in range(0, len(ours) - length + 1, length):
        a = ours[start : start + length]
        if np.isfinite(a).sum() < 0.7 * length or np.nanstd(a) < 0.3 * spread:
            continue
        t = grid.time_s[start] + offset + grid.step_s * np.arange(-search, length + search)
        size = _reference_size(reference, t, grid.step_s)
        if np.isfinite(size).sum() < length:
            continue
        correlation, lag, n = _correlations(a, size)
        is_near = (lag >= 0) & (lag <= 2 * search) & (n >= 0.7 * length)
        if not np.any(is_near):
            continue
        k = int(np.flatnonzero(is_near)[np.argmax(correlation[is_near])])
        if correlation[k] > LOCKED:
            lags.append((lag[k] - search) * grid.step_s)
            middles.append(float(grid.time_s[start] + 0.5 * length * grid.step_s))
            fits.append(np.where(is_near, correlation, -1.0)[(lag >= 0) & (lag <= 2 * search)])
    if len(lags) < 3:
        return offset, 0.0
    found, at = np.array(lags), np.array(middles)
    step = np.diff(found)
    # After a jump the lag persists; after a single stretch that matched a neighbouring turn it returns.
    for k in np.flatnonzero(np.abs(step) > JUMP_S).tolist():
        before, after = np.median(found[max(0, k - 2) : k + 1]), np.median(found[k + 1 : k + 4])
        steady = np.median(np.abs(np.delete(step, k))) if len(step) > 1 else 0.0
        # Motion that repeats fits at a period of its own as well: the shorter side must not fit at the other's lag.
        beyond, others = (fits[: k + 1], after) if k + 1 <= len(found) - k - 1 else (fits[k + 1 :], before)
        there = round(others / grid.step_s) + search
        is_borne_out = len(beyond) >= FEWEST_BEYOND and float(np.median([one[there] for one in beyond])) < LOCKED
        if abs(after - before) > JUMP_S and abs(step[k]) > 5.0 * steady and is_borne_out:
            raise InputError(
                f"{reference.motion.source}: the reference's clock jumps by {after - before:+.3g} s between "
                f"{at[k]:.0f} and {at[k + 1]:.0f} s of the log: cut the reference there and use the parts one by one."
            )
    rate = float(np.median([(found[j] - found[i]) / (at[j] - at[i]) for i in range(len(at)) for j in range(i)]))
    if abs(rate) > FASTEST:
        return offset, 0.0
    return offset + float(np.median(found - rate * at)), rate
