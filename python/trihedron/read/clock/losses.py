"""Samples lost on a clock of known period, which shift the earliest timestamps by periods (docs/reading.md, 4)."""

from itertools import pairwise
from typing import cast

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.ranges import ranges_of
from trihedron.read.clock.period import PAUSE_STEPS, STALL_STEPS

LOST = 0.6
"""Permanent shift of the earliest timestamps, in periods, from which on a sample counts as lost."""
MISS = 1e-2
"""Probability that some block of a whole log has no timestamp that is nearly undelayed."""
SETTLED_OVER = 5
"""Blocks on either side of a place from which the level of the earliest timestamps is estimated."""
UNMOVED = LOST / (2.0 * SETTLED_OVER)
"""Shift from block to block, in periods, of which ``2 SETTLED_OVER`` together are still no loss."""


def block_rows(time_s: FloatArray, period: float, coherence: float) -> int:
    """Rows of a block, of which one is almost certainly undelayed: 2 (θ/T) ln(n/α), and more than a packet."""
    n = len(time_s)
    mean_delay = np.sqrt(float(np.clip(coherence, 0.05, 1.0)) ** -2 - 1.0) / (
        2.0 * np.pi
    )  # of an exponential distribution, in periods
    width = 2.0 * mean_delay * np.log(n / MISS)
    probe = time_s[: 1 << 20]
    close = np.diff(probe) < 0.3 * period
    if close.any():
        runs = np.diff(np.flatnonzero(np.concatenate([[True], ~close, [True]])))
        width = max(width, 2.0 * float(np.percentile(runs[runs > 1], 99.0)) if np.any(runs > 1) else 0.0)
    return int(np.clip(np.ceil(width), 4, max(n // 12, 8)))


def lateness(time_s: FloatArray, tick: IntArray | None, period: float, room: FloatArray) -> FloatArray:
    """``time_s - period * tick``, written into ``room`` (n,); without ticks the row number is the tick."""
    _core.timestamp_lateness(time_s, tick, period, room)
    return room


def ahead(values: FloatArray, reach: int) -> FloatArray:
    """Minimum of each value and the ``reach`` values after it."""
    out = values.copy()
    done = 0
    while done < reach:
        step = min(done + 1, reach - done)
        out[:-step] = np.minimum(out[:-step], out[step:])
        done += step
    return out


def track(
    time_s: FloatArray, period: float, width: int, is_seen: bool, is_sharp: bool, room: FloatArray
) -> tuple[float, IntArray, IntArray, float]:
    """Period, tick of every row, pauses, and the share of blocks that moved back by a period; ``room`` (n,): buffer.

    The earliest timestamp of every block, stalls of the link excluded, shifts by whole periods where samples are lost,
    and slowly if the period is slightly wrong. Without ``is_seen`` the period is corrected from first and last blocks.
    """
    n = len(time_s)
    pauses = _core.steps_above(time_s, PAUSE_STEPS * period)
    edges = np.concatenate([[0], pauses + 1, [n]])
    reach = STALL_STEPS // width + 1
    for _ in range(0 if is_seen else 3):
        late = lateness(time_s, None, period, room)
        slopes, weights = [], []
        for a, b in pairwise(edges):
            if b - a >= 4 * width:
                at = _core.earliest_timestamps(late[a:b], width) + a
                slopes.append(float((late[at[-1]] - late[at[0]]) / (at[-1] - at[0])))
                weights.append(b - a)
        if slopes:
            period += float(np.average(slopes, weights=weights))
    late = lateness(time_s, None, period, room)
    late /= period
    # 32-bit integers where the ticks allow it take half the memory.
    is_short = n + float(time_s[-1] - time_s[0]) / period < 0.5 * np.iinfo(np.int32).max
    lost = cast(IntArray, np.zeros(n, dtype=np.int32 if is_short else np.int64))
    back = blocks = 0
    for a, b in pairwise(edges):
        if not is_seen or b - a < 2 * width:
            continue
        moved_back, n_blocks = _count_losses(late[a:b], width, reach, is_sharp, lost[a:b])
        back, blocks = back + moved_back, blocks + n_blocks
    for a, k in zip(edges, pauses, strict=False):
        # The samples lost in a pause are known from its length alone, of which a late delivery comes back.
        level = late[max(a, k + 1 - width) : k + 1].min()
        lost[k + 1] += max(round(float(late[k + 1 : k + 1 + STALL_STEPS].min() - level)), 0)
    if not lost.any():
        return period, np.arange(n, dtype=lost.dtype), pauses, back / max(blocks, 1)
    # The ticks overwrite the losses, to save memory for a log of 1e8 rows.
    lost += np.int8(1)
    lost[0] -= 1
    tick = np.cumsum(lost, out=lost)
    return period, tick, pauses, back / max(blocks, 1)


def _count_losses(late: FloatArray, width: int, reach: int, is_sharp: bool, lost: IntArray) -> tuple[int, int]:
    """Write the number of samples lost before each row of one section into ``lost``; ``late`` is in periods.

    After the earliest row of the last block losses are counted only where all timestamps are accurate (``is_sharp``).

    Returns the number of blocks that moved back by a period, and that of all blocks.
    """
    at = _core.earliest_timestamps(late, width)
    first = late[at]
    if _is_unmoved(first):
        # Minima over neighbours do not move further either, so nothing is lost.
        _behind_last(late, int(at[-1]), float(first[-1]), is_sharp, lost)
        return 0, len(at)
    first = ahead(first, reach)
    # Moves of less than a loss are drift of the clock.
    moves = np.diff(first)
    count = np.floor(moves + (1.0 - LOST)).astype(np.int64)
    back = int(np.count_nonzero(moves < -LOST))
    _settle(first, count)
    for j in np.flatnonzero(count > 0):
        a, b = int(at[j]), int(at[j + 1])
        if b <= a:
            continue
        inside = late[a + 1 : b + 1] - first[j]
        level = np.minimum.accumulate(inside[::-1])[::-1]
        level[-1] = count[j]
        whole = np.clip(np.floor(level + (1.0 - LOST)).astype(np.int64), 0, count[j])
        whole[-1] = count[j]
        whole = np.maximum.accumulate(whole)
        lost[a + 1 : b + 1] += np.diff(whole, prepend=0)
    _behind_last(late, int(at[-1]), float(first[-1]), is_sharp, lost)
    return back, len(at)


def _is_unmoved(first: FloatArray) -> bool:
    """Whether all earliest timestamps (m,), in periods, are within ``UNMOVED`` of the previous one."""
    count, _, _, least, most = _core.inside_steps(first, -np.inf, np.inf)
    return 0 < count == len(first) - 1 and max(-least, most) <= UNMOVED


def _behind_last(late: FloatArray, at: int, level: float, is_sharp: bool, lost: IntArray) -> None:
    """Write the samples lost after row ``at``, the earliest of the last block, into ``lost``."""
    tail = late[at:] - level
    if is_sharp and len(tail) > 1:
        whole = np.floor(np.minimum.accumulate(tail[::-1])[::-1] + (1.0 - LOST)).astype(np.int64)
        lost[at + 1 :] += np.diff(np.maximum(whole, 0))


def _settle(first: FloatArray, count: IntArray) -> None:
    """Correct ``count`` (m - 1,) where the earliest timestamps (m,), less the losses, stay shifted by a period.

    A block without an undelayed timestamp splits a shift into two parts; one that is early by chance makes a false one.
    """
    m = SETTLED_OVER
    for _ in range(3):
        level = first - np.concatenate([[0], np.cumsum(count)])
        if len(level) < 2 * m + 1:
            return
        middle = _core.running_median(level, m)
        change = np.zeros(len(count))
        change[m // 2 : len(count) - m // 2] = middle[m:] - middle[:-m]
        far = np.abs(change) > LOST
        if not far.any():
            return
        moved = False
        for a, b in ranges_of(far):
            by = int(np.rint(change[a:b][np.argmax(np.abs(change[a:b]))]))
            at = a + int(np.argmax(np.diff(level)[a:b] if by > 0 else count[a:b]))
            by = max(by, -int(count[at]))
            count[at] += by
            moved |= by != 0
        if not moved:
            return


def behind_late_rows(tick: IntArray, error: FloatArray, period: float) -> IntArray:
    """Ticks with each loss moved after the rows whose timestamps it would make earlier than their samples.

    A row before a loss that is late by most of a period looks like a row after it; its ``error`` (n,) [s] relative to
    the even clock is then negative.
    """
    parts = range(1, len(tick), 1 << 18)
    at = np.concatenate([a + np.flatnonzero(np.diff(tick[a - 1 : a + (1 << 18)]) > 1) for a in parts])
    if not len(at):
        return tick
    early = -0.1 * period
    shift = np.zeros_like(tick)
    moved = False
    for i in at:
        k, count = int(i), int(tick[i] - tick[i - 1] - 1)
        while k < len(tick) and k < i + STALL_STEPS and error[k] < early and (k == i or tick[k] == tick[k - 1] + 1):
            shift[k] += count
            k += 1
        moved = moved or k > int(i)
    return np.subtract(tick, shift, out=shift) if moved else tick
