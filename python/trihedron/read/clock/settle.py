"""Which clock a recording gets: its timestamps, or the even clock behind them (docs/reading.md, section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.read.clock.even import EXACT, EvenClock, find_even_clock
from trihedron.read.clock.followed import followed
from trihedron.read.clock.steps import steps_of
from trihedron.records import Finding, FindingCode
from trihedron.records.sampling import Sampling, TimestampKind

WORTH = 0.03
"""Times this part of a step (rms) about an even clock are as good as even (those rounded to a tenth of a step are):
a turn integrated over them errs by less than a thirtieth of what one sample adds."""
SHARED = 0.005
"""Share of samples with the timestamp of the one before, above which timestamps cannot be when samples were taken."""
STANDARD_ERRORS, SYSTEMATIC = 4.0, 0.15
"""A share of 0 or 1 is refused beyond four standard errors and what a filter, or a bent course, makes of it."""
VAGUE = 0.2
"""Standard error of the share above which motion tells nothing."""
ONE_STEP = 0.9
"""Part of the steps a sample counter makes that are its usual one; counters of inner ticks alternate."""


@dataclass(frozen=True, eq=False)
class Settled:
    """``time_s`` (n,) from the first sample on and ``start_s``; the record; ``lost_behind`` (n - 1,) or ``None`` where
    nothing tells; findings."""

    time_s: FloatArray
    start_s: float
    sampling: Sampling
    lost_behind: IntArray | None
    findings: tuple[Finding, ...]


def settle_clock(
    time_s: FloatArray, start_s: float, triads: list[FloatArray], counter: FloatArray | None = None
) -> Settled:
    """The clock of samples with timestamps (n,) and readings (n, 3) in every one of ``triads``.

    Timestamps that two samples share, and those that are an even clock's but for rounding, give way to it; others if
    motion says that the samples were taken evenly. A ``counter`` (n,) that counts samples tells which were lost.
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
        share, sigma = followed(time_s, clock.even_s, clock.tick, triads)
        follows = share - STANDARD_ERRORS * sigma > SYSTEMATIC
        ignores = share + STANDARD_ERRORS * sigma < 1.0 - SYSTEMATIC
        by_itself = shared > SHARED or clock.kind is TimestampKind.ROUNDED
        is_even = not follows and (ignores or by_itself)
    sampling = Sampling(
        clock.kind, clock.period_s, clock.sigma_period_s, clock.timestamp_error_s, is_even, clock.counts_losses,
        int(lost.sum()) if clock.counts_losses else 0, int(np.count_nonzero(lost)) if clock.counts_losses else 0,
        share, sigma,
    )  # fmt: skip
    findings = _findings(sampling, clock, shared)
    told = lost if clock.counts_losses else None
    if not is_even:
        return Settled(time_s, start_s, sampling, told, findings)
    start = float(clock.even_s[0])
    even = clock.even_s - start
    del clock
    # In its own place: a long log has no room for a second.
    return Settled(np.maximum.accumulate(even, out=even), start_s + start, sampling, told, findings)


def _worth(kind: TimestampKind) -> float:
    # Rounding is the file's, not the sensor's, however small: left in the timestamps it would be found as jitter.
    return EXACT if kind is TimestampKind.ROUNDED else WORTH


def sample_numbers(counter: FloatArray) -> IntArray | None:
    """(n,) numbers of samples from 0 on from a counter that counts them (continued where it wraps), or ``None``."""
    if len(counter) < 3 or not np.all(np.isfinite(counter)) or not np.all(counter == np.rint(counter)):
        return None
    step = np.diff(counter)
    if counter.min() >= 0:
        for modulus in (2.0**8, 2.0**16, 2.0**32):
            if counter.max() < modulus:
                step = np.where(step < 0, step + modulus, step)
                break
    if np.any(step <= 0):
        return None
    values, counts = np.unique(step, return_counts=True)
    usual = float(values[np.argmax(counts)])
    if counts.max() < ONE_STEP * len(step) or not np.all(step / usual == np.rint(step / usual)):
        return None
    return np.concatenate([[0], np.cumsum(np.rint(step / usual))]).astype(np.int64)


def _findings(sampling: Sampling, clock: EvenClock, shared: float) -> tuple[Finding, ...]:
    if sampling.timestamp_error_s <= _worth(sampling.kind) * sampling.period_s:
        return ()
    follows = sampling.followed - STANDARD_ERRORS * sampling.sigma_followed > SYSTEMATIC
    follows_wholly = follows and sampling.followed + STANDARD_ERRORS * sampling.sigma_followed > 1.0 - SYSTEMATIC
    return (
        Finding.of(
            FindingCode.EVEN_CLOCK
            if sampling.is_even
            else FindingCode.TIMESTAMPS_KEPT
            if follows_wholly
            else FindingCode.CLOCK_UNDECIDED,
            period_s=sampling.period_s,
            sigma_period_s=sampling.sigma_period_s,
            rate_hz=1.0 / sampling.period_s,
            timestamp_error_s=sampling.timestamp_error_s,
            is_rounded=sampling.kind is TimestampKind.ROUNDED,
            grid_s=clock.grid_s,
            is_late=sampling.kind is TimestampKind.LATE,
            motion_tells=sampling.sigma_followed < VAGUE,
            followed=sampling.followed,
            sigma_followed=sampling.sigma_followed,
            shared_fraction=shared,
            is_partly=follows,
        ),
    )
