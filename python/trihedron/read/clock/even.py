"""The even clock behind a log's stamps, if there is one, and the samples lost on it (docs/reading.md, section 4)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter

from trihedron.read.clock.period import PAUSE_STEPS, find_period
from trihedron.read.table import FloatArray
from trihedron.records.sampling import StampKind

IntArray = npt.NDArray[np.int64]

FEWEST_ROWS = 100
"""Fewer stamps tell no kind of clock."""
LOST = 0.6
"""Part of a period by which the earliest stamps must move, and stay moved, for a sample to be lost."""
UNSEEN = 0.02
"""Part of a period by which stamps may stray from an even clock before anybody asks how it grows."""
EXACT = 0.005
"""Stamps this part of a period about an even clock (rms) are even."""
MISS = 1e-2
"""Chance that no stamp of a whole log's blocks is nearly undelayed."""
GROWTH = 4.0
"""Growth of the variance of a lag's elapsed time over sixteen times the lag, above which no even clock lies behind the
stamps: 16 for steps drawn anew, 1 for an even clock."""
TAKEN_BACK = 0.02
"""Share of blocks whose earliest stamp may move back by a whole period: an even clock's never do."""
CLOSE_PIECES = 60
"""Pieces of a log over which a wandering rate is followed: a thermal drift takes minutes."""
STALL_STEPS = 120
"""A link that stands still for longer than this has paused."""


@dataclass(frozen=True, eq=False)
class EvenClock:
    """``tick`` (n,) number of each sample, lost ones counted; ``even_s`` (n,) when the even clock took it, relative to
    the stamps; ``kind``; ``counts_losses``: whether ``tick`` says what was lost; ``pauses`` (m,) rows behind which the
    logger paused; ``wanders``: the rate changes over the log."""

    kind: StampKind
    period_s: float
    sigma_period_s: float
    tick: IntArray
    even_s: FloatArray
    stamp_error_s: float
    counts_losses: bool
    pauses: IntArray
    grid_s: float = 0.0
    wanders: bool = False

    @property
    def lost_behind(self) -> IntArray:
        """(n - 1,) samples lost behind each row; those of pauses too, as far as the clock tells."""
        return np.asarray(np.diff(self.tick) - 1, dtype=np.int64)


def find_even_clock(time_s: FloatArray, counter: IntArray | None = None) -> EvenClock | None:
    """The even clock behind stamps (n,) in order, or ``None`` for fewer than 100 rows.

    ``counter`` (n,) numbers the samples, lost ones too, from 0 (already continued where it wraps): then it tells the
    losses and the stamps only the rate.
    """
    n = len(time_s)
    if n < FEWEST_ROWS or not time_s[-1] > time_s[0]:
        return None
    found = find_period(time_s)
    period, sees = found.period_s, found.is_seen
    if counter is not None:
        tick, pauses, width, moved_back = counter, np.zeros(0, np.int64), _block(time_s, period, found.coherence), 0.0
        sees = True
        period = _long_run(time_s, counter)
    else:
        width = _block(time_s, period, found.coherence)
        period, tick, pauses, moved_back = _track(time_s, period, width, sees, found.coherence > 0.9)
    even, mean_period, sigma, wanders = _lay(time_s, tick, period, pauses, width, False)
    error = time_s - even
    for _ in range(3 if counter is None and sees else 0):
        # Followed loosely: a loss counted too early makes a dip that the clock must not follow.
        moved = _behind_late_rows(tick, error / period)
        if moved is tick:
            break
        tick = moved
        even, mean_period, sigma, wanders = _lay(time_s, tick, period, pauses, width, False)
        error = time_s - even
    if wanders:
        even, mean_period, sigma, wanders = _lay(time_s, tick, period, pauses, width, False, CLOSE_PIECES)
        error = time_s - even
    on_grid = 0.0 < found.grid_s < 1.3 * period and _range(error) < 1.3 * found.grid_s
    growth = 0.0 if on_grid else _growth(error, pauses, UNSEEN * period)
    if moved_back > TAKEN_BACK or growth > GROWTH or (not sees and growth > 0.5 * GROWTH):
        return EvenClock(StampKind.IRREGULAR, period, sigma, np.arange(n), time_s, 0.0, False, pauses)
    kind = _kind(error, period, found.grid_s)
    if kind is not StampKind.LATE:
        # Two-sided errors have their middle, not their edge, on the clock.
        even, mean_period, sigma, wanders = _lay(time_s, tick, period, pauses, width, True, CLOSE_PIECES)
        error = time_s - even
    rms = float(np.sqrt(np.mean((error - error.mean()) ** 2)))
    return EvenClock(kind, mean_period, sigma, tick, even, rms, sees, pauses, found.grid_s, wanders)


def _long_run(time_s: FloatArray, tick: IntArray) -> float:
    """Period from stamps and their numbers: a line through the earliest stamps of some hundred blocks, thrice."""
    period = float((time_s[-1] - time_s[0]) / max(tick[-1] - tick[0], 1))
    width = max(len(time_s) // 300, 8)
    for _ in range(3):
        late = time_s - period * tick
        at = _argmin_blocks(late, width)
        slope = np.polyfit(tick[at] - tick[at[0]], late[at], 1)[0] if len(at) > 2 else 0.0
        period += float(slope)
    return period


def _block(time_s: FloatArray, period: float, coherence: float) -> int:
    """Rows among which one is all but certainly stamped without delay, 2 (θ/T) ln(n/α), and more than a packet."""
    n = len(time_s)
    mean_delay = np.sqrt(float(np.clip(coherence, 0.05, 1.0)) ** -2 - 1.0) / (
        2.0 * np.pi
    )  # of an exponential law, in periods
    width = 2.0 * mean_delay * np.log(n / MISS)
    probe = time_s[: 1 << 20]
    close = np.diff(probe) < 0.3 * period
    if close.any():
        runs = np.diff(np.flatnonzero(np.concatenate([[True], ~close, [True]])))
        width = max(width, 2.0 * float(np.percentile(runs[runs > 1], 99.0)) if np.any(runs > 1) else 0.0)
    return int(np.clip(np.ceil(width), 4, max(n // 12, 8)))


def _argmin_blocks(late: FloatArray, width: int) -> IntArray:
    """Row of the earliest stamp of every block of ``width`` rows (the last one may be longer)."""
    blocks = max(len(late) // width, 1)
    body = late[: blocks * width].reshape(blocks, -1) if blocks * width <= len(late) else late[None, :]
    at = body.argmin(axis=1) + np.arange(blocks) * body.shape[1]
    rest = late[blocks * width :]
    if len(rest) and rest.min() < late[at[-1]]:
        at[-1] = blocks * width + int(rest.argmin())
    if len(late) - at[-1] > width:
        at = np.append(at, len(late) - width // 2 + int(late[-(width // 2) :].argmin()))
    return np.asarray(at, dtype=np.int64)


def _ahead(values: FloatArray, reach: int) -> FloatArray:
    """Minimum over each value and the ``reach`` that follow it."""
    out = values.copy()
    done = 0
    while done < reach:
        step = min(done + 1, reach - done)
        out[:-step] = np.minimum(out[:-step], out[step:])
        done += step
    return out


def _track(
    time_s: FloatArray, period: float, width: int, sees: bool, is_sharp: bool
) -> tuple[float, IntArray, IntArray, float]:
    """Period, tick of every row, pauses, and the share of blocks that moved back by a period.

    The earliest stamp of every block, a stall of the link looked past, moves by whole periods where samples are lost
    and by a little where the period is not quite right; a period that was not seen comes from first and last stamp.
    """
    n = len(time_s)
    pauses = np.flatnonzero(np.diff(time_s) > PAUSE_STEPS * period)
    edges = np.concatenate([[0], pauses + 1, [n]])
    row = np.arange(n, dtype=np.int64)
    reach = STALL_STEPS // width + 1
    for _ in range(0 if sees else 3):
        late = time_s - period * row
        slopes, weights = [], []
        for a, b in pairwise(edges):
            if b - a >= 4 * width:
                at = _argmin_blocks(late[a:b], width) + a
                slopes.append(float((late[at[-1]] - late[at[0]]) / (at[-1] - at[0])))
                weights.append(b - a)
        if slopes:
            period += float(np.average(slopes, weights=weights))
    late = time_s - period * row
    lost = np.zeros(n, dtype=np.int64)
    back = blocks = 0
    for a, b in pairwise(edges):
        if not sees or b - a < 2 * width:
            continue
        moved_back, n_blocks = _count_losses(late[a:b] / period, width, reach, is_sharp, lost[a:b])
        back, blocks = back + moved_back, blocks + n_blocks
    for k in pauses:
        # How many a pause cost is told no better than its own length.
        lost[k + 1] += max(round(float(time_s[k + 1] - time_s[k]) / period) - 1, 0)
    return period, row + np.cumsum(lost), pauses.astype(np.int64), back / max(blocks, 1)


def _count_losses(late: FloatArray, width: int, reach: int, is_sharp: bool, lost: IntArray) -> tuple[int, int]:
    """Write the samples lost in front of each row of one stretch into ``lost``; ``late`` in periods.

    Behind the last block a loss is counted only where every stamp is nearly right (``is_sharp``).

    Returns the number of blocks that moved back by a period, and of all blocks.
    """
    at = _argmin_blocks(late, width)
    first = _ahead(late[at], reach)
    # The level the clock itself drifts on: the part of the moves that is not whole periods.
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
    tail = late[at[-1] :] - first[-1]
    if is_sharp and len(tail) > 1:
        whole = np.floor(np.minimum.accumulate(tail[::-1])[::-1] + (1.0 - LOST)).astype(np.int64)
        lost[at[-1] + 1 :] += np.diff(np.maximum(whole, 0))
    return back, len(at)


def _settle(first: FloatArray, count: IntArray) -> None:
    """Correct ``count`` (m - 1,) where the level of the earliest stamps (m,), losses taken off, stays a period away.

    A block without an early stamp hides the move to the next level in two halves; a chance early one invents a move.
    """
    m = 5
    for _ in range(3):
        level = first - np.concatenate([[0], np.cumsum(count)])
        if len(level) < 2 * m + 1:
            return
        middle = median_filter(level, m, mode="nearest")
        change = np.zeros(len(count))
        change[m // 2 : len(count) - m // 2] = middle[m:] - middle[:-m]
        far = np.abs(change) > LOST
        if not far.any():
            return
        starts = np.flatnonzero(np.diff(np.concatenate([[False], far, [False]]).astype(np.int8)) == 1)
        stops = np.flatnonzero(np.diff(np.concatenate([[False], far, [False]]).astype(np.int8)) == -1)
        moved = False
        for a, b in zip(starts, stops, strict=True):
            by = int(np.rint(change[a:b][np.argmax(np.abs(change[a:b]))]))
            at = a + int(np.argmax(np.diff(level)[a:b] if by > 0 else count[a:b]))
            by = max(by, -int(count[at]))
            count[at] += by
            moved |= by != 0
        if not moved:
            return


def _lay(
    time_s: FloatArray,
    tick: IntArray,
    period: float,
    pauses: IntArray,
    width: int,
    through_middle: bool,
    pieces: int = 12,
) -> tuple[FloatArray, float, float, bool]:
    """The even clock (n,) under the earliest stamps, or through the middle of all; its mean period over the
    longest stretch and the standard error of that;
    whether its rate wanders, followed in so many ``pieces``."""
    late = time_s - period * tick
    even = np.empty_like(late)
    edges = np.concatenate([[0], pauses + 1, [len(late)]])
    sigma, longest, wanders, slope = np.inf, 0, False, 0.0
    for a, b in pairwise(edges):
        piece = late[a:b]
        if b - a < 4 * width:
            even[a:b] = piece.min() + period * tick[a:b]
            continue
        if through_middle:
            cut = (b - a) // width * width
            x = tick[a : a + cut].reshape(-1, width).mean(axis=1)
            y = each = np.median(piece[:cut].reshape(-1, width), axis=1)
        else:
            at = _argmin_blocks(piece, width)
            x, each = tick[a:b][at].astype(np.float64), piece[at]
            y = _ahead(each, STALL_STEPS // width + 1)
        x0, scale = x.mean(), max(float(np.ptp(x)), 1.0)
        u = (x - x0) / scale
        line = _robust_line(u, y)
        left = y - np.polyval(line, u)
        noise = 1.4826 * float(np.median(np.abs(np.diff(each)))) / np.sqrt(2.0) + 1e-3 * period
        size = min(max(len(y) // 12, 5), 401) | 1
        smooth = median_filter(left, size, mode="nearest")
        # Wander: the smoothed rest is far more than the blocks' own scatter leaves in it.
        curved = float(np.std(smooth)) > max(8.0 * noise / np.sqrt(size), UNSEEN * period)
        even[a:b] = np.polyval(line, (tick[a:b] - x0) / scale)
        if curved and len(y) >= 24:
            wanders = True
            even[a:b] += np.interp(
                tick[a:b], x, median_filter(left, min(max(len(y) // pieces, 5), 101) | 1, mode="nearest")
            )
        even[a:b] += period * tick[a:b]
        if b - a > longest:
            longest, slope = b - a, float(line[0]) / scale
            spread = float(np.std(left - smooth if curved else left))
            # Neighbouring blocks share what delays them: four count as one.
            sigma = spread / scale / max(float(np.std(u)), 1e-9) / np.sqrt(max(len(y) / 4.0, 1.0))
    digits = float(np.spacing(np.abs(time_s).max())) / max(int(tick[-1] - tick[0]), 1)
    return even, period + slope, float(np.hypot(sigma, digits)), wanders


def _robust_line(u: FloatArray, y: FloatArray) -> FloatArray:
    """Straight line through points of which some are far too late."""
    keep = np.ones(len(y), dtype=bool)
    line = np.polyfit(u, y, 1)
    for _ in range(3):
        left = y - np.polyval(line, u)
        limit = 4.0 * 1.4826 * float(np.median(np.abs(left - np.median(left)))) + 1e-12
        keep = np.abs(left - np.median(left)) <= limit
        if keep.sum() < 3:
            break
        line = np.polyfit(u[keep], y[keep], 1)
    return np.asarray(line)


def _behind_late_rows(tick: IntArray, error: FloatArray) -> IntArray:
    """Ticks with every loss put behind the rows that it would have stamped before they were taken.

    A row late by most of a period in front of a loss looks like one behind it; counted so its ``error`` (n,), in
    periods about the earliest stamps, is negative.
    """
    lost = np.diff(tick, prepend=tick[0] - 1) - 1
    at = np.flatnonzero(lost > 0)
    if not len(at):
        return tick
    early = -0.1
    shift = np.zeros(len(tick), dtype=np.int64)
    moved = False
    for i in at:
        k, count = int(i), int(lost[i])
        while k < len(tick) and k < i + STALL_STEPS and error[k] < early and lost[k] == (count if k == i else 0):
            shift[k] += count
            k += 1
        moved = moved or k > int(i)
    return tick - shift if moved else tick


def _growth(error: FloatArray, pauses: IntArray, unseen: float) -> float:
    """Variance of the change of the stamps' error over 16 m rows over that over m, m as long as the log allows."""
    edges = np.concatenate([[0], pauses + 1, [len(error)]])
    longest = int(np.argmax(np.diff(edges)))
    piece = error[edges[longest] : edges[longest + 1]][: 1 << 20]
    far = min(len(piece) // 8, 1024)
    near = max(far // 16, 1)

    def typical(lag: int) -> float:
        change = np.abs(piece[lag:] - piece[:-lag])
        return float(np.mean(np.minimum(change, 8.0 * np.median(change) + 1e-300) ** 2))

    return typical(far) / max(typical(near), unseen**2)


def _range(error: FloatArray) -> float:
    """Width that holds all but 2 % of the errors: those next to a loss may stand on its wrong side."""
    low, high = np.percentile(error[:: max(len(error) // 100_000, 1)], [1.0, 99.0])
    return float(high - low)


def _kind(error: FloatArray, period: float, grid: float) -> StampKind:
    """Kind of stamps from their errors (n,) about the even clock."""
    probe = error[:: max(len(error) // 100_000, 1)]
    low, middle, high = np.percentile(probe, [0.2, 50.0, 99.8])
    rms = float(np.std(probe))
    if rms < EXACT * period:
        return StampKind.EXACT
    if 0.0 < grid < 1.3 * period and _range(error) < 1.3 * grid:
        return StampKind.ROUNDED
    # One-sided: the early edge is sharp, the late one runs out; or samples come in packets.
    together = float(np.mean(np.diff(error) < -0.7 * period))
    if high - middle > 2.0 * (middle - low) or together > 0.02 or high - low > 1.0 * period:
        return StampKind.LATE
    return StampKind.SCATTERED
