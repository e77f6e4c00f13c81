"""Laws by which a logger stamps its samples, each with what truly happened: when, how fast, and what was lost.

Every law is written from how loggers work, not from how they are read: a sensor ticks, samples vanish on their way, a
queue delays them, a clock stamps and rounds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Rng = np.random.Generator


@dataclass(frozen=True, eq=False)
class Stamped:
    """``stamp_s`` (n,) as logged, ``taken_s`` (n,) when the samples were taken, ``tick`` (n,) their number from 0 on.

    ``is_even``: the samples were taken evenly (but for a wandering rate). ``n_lost`` between first and last row;
    ``pause_after`` (m,) rows behind which the logger paused for an unknown time (its losses do not count).
    """

    law: str
    period_s: float
    stamp_s: FloatArray
    taken_s: FloatArray
    tick: IntArray
    is_even: bool
    pause_after: IntArray

    @property
    def lost_behind(self) -> IntArray:
        """(n - 1,) samples lost behind each row, pauses apart."""
        lost = np.diff(self.tick) - 1
        lost[self.pause_after] = 0
        return lost


def ticks(n: int, rng: Rng, loss: float, burst: float) -> IntArray:
    """(n,) numbers of the samples that arrived: single ones are lost with probability ``loss``, bursts of 2 to 30 with
    probability ``burst``."""
    step = np.ones(n, dtype=np.int64)
    step += rng.random(n) < loss
    hit = rng.random(n) < burst
    step[hit] += rng.integers(2, 31, int(hit.sum()))
    step[0] = 0
    return np.cumsum(step)


def sensor_clock(tick: IntArray, period_s: float, rng: Rng, wander: float) -> FloatArray:
    """Instants of the ticks; the rate wanders by ``wander`` (relative) over a fifth to the whole of the log."""
    if wander == 0.0:
        return period_s * tick
    total = max(int(tick[-1]), 1)
    turns, phase = rng.uniform(0.5, 2.5), rng.uniform(0, 2 * np.pi)
    angle = 2 * np.pi * turns * tick / total
    swing = total / (2 * np.pi * turns) * (np.cos(phase) - np.cos(angle + phase))
    return np.asarray(period_s * (tick + wander * swing))


def in_order(arrival: FloatArray) -> FloatArray:
    """A queue: nothing arrives before what was sent before it."""
    return np.maximum.accumulate(arrival)


def exact(taken: FloatArray, _period_s: float, _rng: Rng) -> FloatArray:
    return np.round(taken, 9)


def rounded(taken: FloatArray, period_s: float, rng: Rng) -> FloatArray:
    grid = period_s * rng.choice([0.05, 0.1, 0.25, 0.51]) * rng.uniform(0.93, 1.07)
    return np.asarray(np.floor(taken / grid + rng.random()) * grid)


def milliseconds(taken: FloatArray, period_s: float, rng: Rng) -> FloatArray:
    """Whole decimal ticks of the logger's clock, four to forty in a step (a sensor near 100 Hz in milliseconds)."""
    grid = 10.0 ** np.floor(np.log10(period_s / 4.0))
    return np.asarray(np.round(taken / grid + rng.random()) * grid)


def late(taken: FloatArray, period_s: float, rng: Rng) -> FloatArray:
    """Independent exponential delays of a tenth to eight tenths of a step behind a fixed one, in a queue."""
    mean = period_s * rng.uniform(0.1, 0.8)
    return np.round(in_order(taken + rng.exponential(mean, len(taken))), 6)


def stalled(taken: FloatArray, period_s: float, rng: Rng) -> FloatArray:
    """Small delays, and now and then a link that stands still for 5 to 40 steps and then gives all at once."""
    arrival = taken + rng.exponential(0.05 * period_s, len(taken))
    for _ in range(max(len(taken) // 700, 1)):
        k = int(rng.integers(0, len(taken)))
        until = taken[k] + period_s * rng.uniform(5, 40)
        held = slice(k, int(np.searchsorted(taken, until)))
        arrival[held] = np.maximum(arrival[held], until)
    return np.round(in_order(arrival), 6)


def batched(taken: FloatArray, period_s: float, rng: Rng) -> FloatArray:
    """Packets of several samples, all stamped when the packet came, a little late."""
    size = int(rng.integers(2, 13))
    n = len(taken)
    last = np.minimum(np.arange(n) // size * size + size - 1, n - 1)
    delay = np.repeat(rng.exponential(0.15 * period_s, n // size + 1), size)[:n]
    return np.round(in_order(taken[last] + delay), 6)


def polled(taken: FloatArray, period_s: float, rng: Rng) -> FloatArray:
    """A computer that looks for new samples at its own beat (2.3 to 4.7 steps) and stamps what it finds alike."""
    beat = period_s * rng.uniform(2.3, 4.7)
    return np.round(np.ceil(taken / beat) * beat, 6)


def scattered(taken: FloatArray, period_s: float, rng: Rng) -> FloatArray:
    """Two-sided: a stamp that wobbles by 1 to 12 % of a step about the sample."""
    return np.round(in_order(taken + period_s * rng.uniform(0.01, 0.12) * rng.standard_normal(len(taken))), 6)


LAWS: dict[str, Callable[[FloatArray, float, Rng], FloatArray]] = {
    "exact": exact, "rounded": rounded, "milliseconds": milliseconds, "late": late, "stalled": stalled,
    "batched": batched, "polled": polled, "scattered": scattered,
}  # fmt: skip
IRREGULAR = ("renewal", "loop")


def irregular(law: str, n: int, period_s: float, rng: Rng) -> FloatArray:
    """Instants of sampling that are not even, and are stamped right.

    ``renewal``: each step is drawn anew (5 to 40 % scatter). ``loop``: a program that works 0.2 to 0.5 % more or less
    in every turn and every so often much longer, each turn starting where the last ended.
    """
    if law == "renewal":
        scatter = rng.uniform(0.05, 0.4)
        return np.asarray(np.cumsum(period_s * rng.gamma(scatter**-2, scatter**2, n)))
    step = period_s * (1 + rng.uniform(0.02, 0.05) * rng.standard_normal(n))
    step[rng.random(n) < 0.02] += period_s * rng.uniform(0.3, 3.0)
    return np.asarray(np.cumsum(np.abs(step)))


def draw(
    law: str,
    n: int,
    rate_hz: float,
    seed: int,
    loss: float = 0.0,
    burst: float = 0.0,
    wander: float = 0.0,
    pauses: int = 0,
) -> Stamped:
    """Stamps of one imagined log of ``n`` rows."""
    rng = np.random.default_rng([seed, sum(map(ord, law))])
    period_s = 1.0 / rate_hz * float(1 + 0.004 * rng.standard_normal())  # no clock runs at its nominal rate
    if law in IRREGULAR:
        taken = irregular(law, n, period_s, rng)
        taken -= taken[0]
        stamp = np.round(taken, 6)
        return Stamped(law, (taken[-1] - taken[0]) / (n - 1), stamp, taken, np.arange(n), False, np.zeros(0, np.int64))
    tick = ticks(n, rng, loss, burst)
    taken = sensor_clock(tick, period_s, rng, wander)
    pause_after = np.sort(rng.choice(np.arange(n // 10, n - n // 10), pauses, replace=False)) if pauses else []
    for k in pause_after:
        taken[k + 1 :] += period_s * rng.uniform(60, 5000)
    # What is held back when the logger pauses is written before it does.
    parts = np.split(taken, np.asarray(pause_after, dtype=np.int64) + 1)
    stamp = np.concatenate([LAWS[law](part, period_s, np.random.default_rng([seed, 7])) for part in parts])
    start = stamp[0]
    return Stamped(law, period_s, stamp - start, taken - start, tick, True, np.asarray(pause_after, np.int64))
