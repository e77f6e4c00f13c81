"""Chooses the clock of a recording: its timestamps, or an even clock (docs/reading.md, section 4)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import TINY, FloatArray, IntArray
from trihedron.read.clock.even import EXACT, SHARED, EvenClock, find_even_clock
from trihedron.read.clock.rate import steps_of, steps_of_counter
from trihedron.records import Finding
from trihedron.records.sampling import Sampling, TimestampKind

CONTRAST = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / 6.0
"""Weights of a sample's deviation from the cubic through its four neighbours, on an even grid."""
REACH = 3
"""Samples on either side for the slope: the sum over k = 1 to 3 of k (x_{+k} - x_{-k}), divided by 28."""
CLEAR_SLOPE = 3.0
"""Smallest slope, in its standard errors, at which a reading is used to determine its time."""
FARTHEST = 1.5
"""Largest deviation of a timestamp from the even clock, in steps, for which motion is extrapolated linearly."""
PART, PARTS = 1 << 17, 8
"""Rows of a section, and number of sections with the most motion that are used of a long log."""
BLOCK = 50
"""Rows of a block; deviations of neighbouring rows are correlated, so errors are estimated from blocks."""


def followed(time_s: FloatArray, even_s: FloatArray, tick: IntArray, triads: list[FloatArray]) -> tuple[float, float]:
    """Share s of the timestamps' scatter about an even clock that the readings (n, 3) follow, and its standard error.

    The reading of a sample taken δ later is larger by x' δ, and deviates from the cubic through its neighbours by the
    contrast of that; s is the slope of the measured on the predicted deviation over all channels in motion. s = 1 means
    that samples were taken at their timestamps, s = 0 evenly. The error is from blocks, infinite without motion.
    """
    step_s = float((even_s[-1] - even_s[0]) / max(int(tick[-1] - tick[0]), 1))
    top = np.zeros(0)
    bottom = np.zeros(0)
    for rows in _active(triads, len(time_s)):
        t, b = _sums(time_s[rows] - even_s[rows], step_s, tick[rows], [x[rows] for x in triads])
        top, bottom = np.concatenate([top, t]), np.concatenate([bottom, b])
    total = float(bottom.sum())
    if len(bottom) < 10 or total <= 0.0:
        return 0.0, float("inf")
    share = float(top.sum()) / total
    return share, float(np.sqrt(np.sum((top - share * bottom) ** 2))) / total


def _active(triads: list[FloatArray], n: int) -> list[slice]:
    parts = [slice(a, min(a + PART, n)) for a in range(0, n, PART)]
    if len(parts) <= PARTS:
        return parts
    activity = np.zeros(len(parts))
    for x in triads:
        spread = np.array([_spread(x[p][::16]) for p in parts])
        activity += spread / max(float(np.median(spread)), TINY)
    return [parts[k] for k in sorted(np.argsort(activity)[::-1][:PARTS])]


def _spread(x: FloatArray) -> float:
    """Standard deviation of the finite rows (n, 3), summed over the axes; 0 without such rows."""
    whole = x[np.isfinite(x).all(axis=1)]
    return float(whole.std(axis=0).sum()) if len(whole) else 0.0


def _sums(late: FloatArray, step_s: float, tick: IntArray, triads: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Sums per block of deviation times prediction and of squared prediction."""
    from scipy.ndimage import uniform_filter1d  # imported here because most logs do not need it

    n = len(late)
    margin = REACH + 2
    if n < 4 * BLOCK:
        return np.zeros(0), np.zeros(0)
    inner = np.arange(margin, n - margin)
    # Only where no sample is lost within reach.
    whole = tick[inner + margin] - tick[inner - margin] == 2 * margin
    late = (late - np.median(late)) / step_s
    near = np.abs(late) < FARTHEST
    whole &= near[inner] & near[inner - 1] & near[inner + 1] & near[inner - 2] & near[inner + 2]
    top, bottom = np.zeros(len(inner)), np.zeros(len(inner))
    for x in triads:
        for axis in range(3):
            column = x[:, axis]
            change = np.abs(np.diff(column))
            change = change[np.isfinite(change)]
            if not len(change):
                continue
            noise = float(np.median(change)) / 0.954  # of one reading: √2 · 0.6745
            noise = max(noise, float(change.max()) * 1e-6)
            if not noise > 0.0:
                continue
            y = column / noise
            slope = np.sum([k * (np.roll(y, -k) - np.roll(y, k)) for k in range(1, REACH + 1)], axis=0) / 28.0
            left = np.convolve(y, CONTRAST, mode="same")[inner]
            made = np.convolve(slope * late, CONTRAST, mode="same")[inner]
            good = whole & np.isfinite(left) & np.isfinite(made) & (np.abs(slope[inner]) > CLEAR_SLOPE / np.sqrt(28.0))
            left, made = np.where(good, left, 0.0), np.where(good, made, 0.0)
            # Rapid motion deviates from a cubic by itself: rows are weighted by the residuals around them.
            around = uniform_filter1d(left**2, 33, mode="nearest") / np.maximum(
                uniform_filter1d(good.astype(np.float64), 33, mode="nearest"), 1.0 / 33.0
            )
            weight = good / (2.0 + around)
            top += weight * left * made
            bottom += weight * made**2
    m = len(inner) // BLOCK * BLOCK
    return top[:m].reshape(-1, BLOCK).sum(axis=1), bottom[:m].reshape(-1, BLOCK).sum(axis=1)


WORTH = 0.03
"""Rms deviation from an even clock, in steps, below which timestamps need no correction (those rounded to a tenth of a
step are below it): the error of a rotation integrated over them is less than 1/30 of one sample's contribution."""
STANDARD_ERRORS, SYSTEMATIC = 4.0, 0.15
"""A share of 0 or 1 is rejected beyond four standard errors plus the bias that a filter or curved motion may cause."""
VAGUE = 0.2
"""Standard error of the share above which motion does not decide."""
ONE_STEP = 0.9
"""Smallest share of a sample counter's steps that equal its usual step; counters of internal ticks alternate."""


@dataclass(frozen=True, eq=False)
class Settled:
    """``time_s`` (n,) [s] from the first sample on, and ``start_s``; the ``sampling`` record; ``lost_behind`` (n - 1,),
    or ``None`` where losses are unknown; findings."""

    time_s: FloatArray
    start_s: float
    sampling: Sampling
    lost_behind: IntArray | None
    findings: tuple[Finding, ...]


def settle_clock(
    time_s: FloatArray, start_s: float, triads: Mapping[str, FloatArray], counter: FloatArray | None = None
) -> Settled:
    """The clock of samples with timestamps (n,) and readings (n, 3) in each of ``triads``, by name.

    Timestamps that samples share, and those of a rounded even clock, are replaced by the even clock unless the motion
    follows them; others only if the motion shows that sampling was even. A ``counter`` (n,) of samples shows losses.
    """
    clock = find_even_clock(time_s)
    numbers = None if counter is None else sample_numbers(counter)
    if clock is not None and numbers is not None and clock.kind not in (TimestampKind.EXACT, TimestampKind.ROUNDED):
        counted = find_even_clock(time_s, numbers)
        if counted is not None and counted.kind is not TimestampKind.IRREGULAR:
            clock = counted
    if clock is None:
        return Settled(time_s, start_s, Sampling(), None, ())
    if clock.kind is TimestampKind.IRREGULAR:
        return Settled(time_s, start_s, Sampling(TimestampKind.IRREGULAR, clock.period_s), None, ())
    lost = clock.lost_behind
    share, sigma = 0.0, float("inf")
    shared = steps_of(time_s).same / (len(time_s) - 1)
    is_even = False
    if clock.timestamp_error_s > _worth(clock.kind) * clock.period_s:
        share, sigma = followed(time_s, clock.even_s, clock.tick, list(triads.values()))
        follows, ignores = _decided(share, sigma)
        by_itself = shared > SHARED or clock.kind is TimestampKind.ROUNDED
        is_even = not follows and (ignores or by_itself)
    sampling = Sampling(
        clock.kind, clock.period_s, clock.sigma_period_s, clock.timestamp_error_s, is_even, clock.counts_losses,
        int(lost.sum()) if clock.counts_losses else 0, share, sigma,
    )  # fmt: skip
    findings = _findings(sampling, clock, shared, tuple(triads))
    told = lost if clock.counts_losses else None
    if not is_even:
        return Settled(time_s, start_s, sampling, told, findings)
    start = float(clock.even_s[0])
    even = clock.even_s - start
    del clock
    # In place, to save memory for a long log.
    return Settled(np.maximum.accumulate(even, out=even), start_s + start, sampling, told, findings)


def _decided(share: float, sigma: float) -> tuple[bool, bool]:
    """Whether the motion follows the timestamps' scatter at all, and whether it follows less than all of it."""
    reach = STANDARD_ERRORS * sigma
    return share - reach > SYSTEMATIC, share + reach < 1.0 - SYSTEMATIC


def _worth(kind: TimestampKind) -> float:
    # Rounding is an error of the file, not of the sensor: even small rounding would otherwise be found as jitter.
    return EXACT if kind is TimestampKind.ROUNDED else WORTH


def sample_numbers(counter: FloatArray) -> IntArray | None:
    """(n,) numbers of samples from 0 on, from a sample counter (continued where it wraps); ``None`` for others."""
    if len(counter) < 3 or not np.all(np.isfinite(counter)) or not np.all(counter == np.rint(counter)):
        return None
    step = steps_of_counter(counter)
    if np.any(step <= 0):
        return None
    values, counts = np.unique(step, return_counts=True)
    usual = float(values[np.argmax(counts)])
    if counts.max() < ONE_STEP * len(step) or not np.all(step / usual == np.rint(step / usual)):
        return None
    return np.concatenate([[0], np.cumsum(np.rint(step / usual))]).astype(np.int64)


def _findings(sampling: Sampling, clock: EvenClock, shared: float, sensors: tuple[str, ...]) -> tuple[Finding, ...]:
    if sampling.timestamp_error_s <= _worth(sampling.kind) * sampling.period_s:
        return ()
    follows, ignores = _decided(sampling.followed, sampling.sigma_followed)
    return (
        Finding.of(
            "even-clock" if sampling.is_even else "timestamps-kept" if follows and not ignores else "clock-undecided",
            period_s=sampling.period_s,
            sigma_period_s=sampling.sigma_period_s,
            rate_hz=1.0 / sampling.period_s,
            timestamp_error_s=sampling.timestamp_error_s,
            is_rounded=sampling.kind is TimestampKind.ROUNDED,
            grid_s=clock.grid_s,
            is_late=sampling.kind is TimestampKind.LATE,
            motion_shows=sampling.sigma_followed < VAGUE,
            followed=sampling.followed,
            sigma_followed=sampling.sigma_followed,
            shared_fraction=shared,
            is_partly=follows,
            is_of_one=len(sensors) == 1,
            sensor=sensors[0].replace("gyroscope", "gyro") if sensors else "",
        ),
    )
