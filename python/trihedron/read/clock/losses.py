"""Samples lost on a clock of known period, which shift the earliest timestamps by periods (docs/reading.md, 4)."""

from itertools import pairwise
from typing import cast

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.read.clock.period import PAUSE_STEPS, STALL_STEPS

LOST = 0.6
"""Permanent shift of the earliest timestamps, in periods, from which on a sample counts as lost."""
MISS = 1e-2
"""Probability that some block of a whole log has no timestamp that is nearly undelayed."""
UNMOVED = 0.06
"""Shift from block to block, in periods, that is a drift of the clock: ten of them together are still no loss."""


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
    time_s: FloatArray, period: float, width: int, is_seen: bool, room: FloatArray
) -> tuple[IntArray, IntArray, float]:
    """Tick of every row, pauses, and the share of blocks that moved back by a period; ``room`` (n,): buffer.

    The earliest timestamp of every block, stalls of the link excluded, shifts by whole periods where samples are lost,
    and slowly if the period is slightly wrong. Without ``is_seen`` none is lost outside pauses.
    """
    n = len(time_s)
    pauses = _core.steps_above(time_s, PAUSE_STEPS * period)
    edges = np.concatenate([[0], pauses + 1, [n]])
    reach = STALL_STEPS // width + 1
    late = lateness(time_s, None, period, room)
    late /= period
    # 32-bit integers where the ticks allow it take half the memory.
    is_short = n + float(time_s[-1] - time_s[0]) / period < 0.5 * np.iinfo(np.int32).max
    lost = cast(IntArray, np.zeros(n, dtype=np.int32 if is_short else np.int64))
    back = blocks = 0
    for a, b in pairwise(edges):
        if not is_seen or b - a < 2 * width:
            continue
        moved_back, n_blocks = _count_losses(late[a:b], width, reach, lost[a:b])
        back, blocks = back + moved_back, blocks + n_blocks
    for a, k in zip(edges, pauses, strict=False):
        # The samples lost in a pause are known from its length alone, of which a late delivery comes back.
        level = late[max(a, k + 1 - width) : k + 1].min()
        lost[k + 1] += max(round(float(late[k + 1 : k + 1 + STALL_STEPS].min() - level)), 0)
    if not lost.any():
        return np.arange(n, dtype=lost.dtype), pauses, back / max(blocks, 1)
    # The ticks overwrite the losses, to save memory for a log of 1e8 rows.
    lost += np.int8(1)
    lost[0] -= 1
    tick = np.cumsum(lost, out=lost)
    return tick, pauses, back / max(blocks, 1)


def _count_losses(late: FloatArray, width: int, reach: int, lost: IntArray) -> tuple[int, int]:
    """Write the number of samples lost before each row of one section into ``lost``; ``late`` is in periods.

    After the earliest row of the last block none is counted: rows that are late look like rows behind a loss.

    Returns how often blocks moved back by a period, and the number of all blocks.
    """
    at = _core.earliest_timestamps(late, width)
    first = late[at]
    if _is_unmoved(first):
        # Minima over neighbours do not move further either, so nothing is lost.
        return 0, len(at)
    first = ahead(first, reach)
    count, level, back = _shifts(first)
    for j in np.flatnonzero(count > 0):
        a, b = int(at[j]), int(at[j + 1])
        if b > a:
            _place(late[a + 1 : b + 1] - level[j], int(count[j]), lost[a + 1 : b + 1])
    return back, len(at)


def _shifts(first: FloatArray) -> tuple[IntArray, FloatArray, int]:
    """Samples lost behind each of the earliest timestamps (m,), in periods, but the last; the level (m - 1,) of the
    clock there, less the losses before; and how often they moved back by a period.

    The level follows a drift, but not the block that has no undelayed timestamp, or one that is early by chance.
    """
    count, levels = np.zeros(len(first) - 1, dtype=np.int64), np.zeros(len(first) - 1)
    level, back, was_back = float(first[0]), 0, False
    for j, value in enumerate(first[1:].tolist()):
        moved = value - level
        levels[j], count[j] = level, max(int(np.floor(moved + (1.0 - LOST))), 0)
        is_back = moved < -LOST
        back, was_back = back + (is_back and not was_back), is_back
        level += int(count[j]) + min(max(moved - int(count[j]), -UNMOVED), UNMOVED)
    return count, levels, back


def _place(inside: FloatArray, count: int, lost: IntArray) -> None:
    """Add ``count`` losses to rows (k,) that are late by ``inside`` (k,) about the clock before them; the last row is
    behind all of them."""
    level = np.minimum.accumulate(inside[::-1])[::-1]
    whole = np.clip(np.floor(level + (1.0 - LOST)).astype(np.int64), 0, count)
    whole[-1] = count
    lost += np.diff(np.maximum.accumulate(whole), prepend=0)


def _is_unmoved(first: FloatArray) -> bool:
    """Whether all earliest timestamps (m,), in periods, are within ``UNMOVED`` of the previous one."""
    count, _, _, least, most = _core.inside_steps(first, -np.inf, np.inf)
    return 0 < count == len(first) - 1 and max(-least, most) <= UNMOVED
