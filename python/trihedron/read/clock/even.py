"""The even clock from which a log's timestamps deviate, if any, and the lost samples (docs/reading.md, section 4)."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, FloatArray, IntArray
from trihedron.quantiles import MAD_TO_SIGMA, median, quantiles
from trihedron.read.clock.losses import ahead, block_rows, lateness, track
from trihedron.read.clock.period import FEWEST_TIMESTAMPS, STALL_STEPS, find_period
from trihedron.read.clock.rate import mean_rate_hz, steps_of
from trihedron.records.sampling import TimestampKind

FEWEST_ROWS = 100
"""Smallest number of timestamps from which a clock is determined."""
UNSEEN = 0.02
"""Deviation from an even clock, in periods, below which neither its growth nor a drift of the rate is tested."""
EXACT = 0.005
"""Rms deviation from an even clock, in periods, below which timestamps are exact."""
SHARED = 0.005
"""Share of samples with the previous sample's timestamp above which timestamps cannot be the instants of sampling."""
GROWTH = 4.0
"""Ratio of the variances of elapsed-time errors over 16 m and over m rows, above which there is no even clock: 16 for
independent steps, 1 for an even clock."""
TAKEN_BACK = 0.02
"""Largest share of blocks whose earliest timestamp moves back by a whole period; with an even clock none does."""
MOST_BLOCKS = 1 << 18
"""Largest number of blocks of a section to whose earliest timestamps the clock is fitted."""
PIECES = 60
"""Pieces of a log in which a drifting rate is followed; thermal drift takes minutes."""


@dataclass(frozen=True, eq=False)
class EvenClock:
    """``tick`` (n,): number of each sample, lost ones counted; ``even_s`` (n,): its instant on the even clock, in the
    time of the timestamps [s]; ``kind`` of the timestamps; ``counts_losses``: whether ``tick`` counts lost samples."""

    kind: TimestampKind
    period_s: float
    sigma_period_s: float
    tick: IntArray
    even_s: FloatArray
    timestamp_error_s: float
    counts_losses: bool
    grid_s: float = 0.0

    @property
    def lost_behind(self) -> IntArray:
        """(n - 1,) samples lost after each row, those of pauses included as far as the clock shows them."""
        if int(self.tick[-1] - self.tick[0]) == len(self.tick) - 1:
            # Ticks increase, so nothing is lost and no array is needed.
            return np.broadcast_to(np.zeros(1, self.tick.dtype), len(self.tick) - 1)
        lost = np.diff(self.tick)
        lost -= 1
        return lost


def find_even_clock(time_s: FloatArray, counter: IntArray | None = None) -> EvenClock | None:
    """The even clock of timestamps (n,) in order, or ``None`` for fewer than 100 rows.

    ``counter`` (n,) numbers the samples, lost ones too, from 0 (already continued where it wraps): then losses are
    from the counter, and only the rate is from the timestamps.
    """
    n = len(time_s)
    if n < FEWEST_ROWS or not time_s[-1] > time_s[0]:
        return None
    found = find_period(time_s)
    period, is_seen = found.period_s, found.is_seen
    # One buffer for lateness, clock and error in turn: a second one takes memory and time for a long log.
    room = _core.new_array(n, 1).reshape(-1)
    width = block_rows(time_s, period, found.coherence)
    if counter is not None:
        tick, pauses, moved_back, is_seen = counter, np.zeros(0, np.int64), 0.0, True
        period = float((time_s[-1] - time_s[0]) / max(counter[-1] - counter[0], 1))
    else:
        tick, pauses, moved_back = track(time_s, period, width, is_seen, room)
    # Rounding to a grid moves a difference of two timestamps by its step / √6 rms, at any lag.
    rounding = found.grid_s / np.sqrt(6.0) if is_seen and found.grid_s < period else 0.0
    unseen = max(UNSEEN * period, rounding)
    even, mean_period, sigma = _lay(time_s, tick, period, pauses, (width, unseen), False, room)
    error = _error(time_s, even)
    growth = _growth(error, pauses, unseen)
    if moved_back > TAKEN_BACK or growth > GROWTH or (not is_seen and growth > 0.5 * GROWTH):
        steps = steps_of(time_s)
        if steps.same <= SHARED * (n - 1) or steps.forward < FEWEST_TIMESTAMPS:
            return EvenClock(TimestampKind.IRREGULAR, period, sigma, np.arange(n), time_s, 0.0, False)
        # Samples of packets were lost, and nothing shows how many.
        is_seen, period = False, 1.0 / mean_rate_hz(time_s)
        tick, pauses, _ = track(time_s, period, width, is_seen, room)
        even, mean_period, sigma = _lay(time_s, tick, period, pauses, (width, unseen), False, room)
        error = _error(time_s, even)
    kind = _kind(error, period, found.grid_s)
    if kind is not TimestampKind.LATE:
        # For two-sided errors the clock is at their middle, not at their edge.
        even, mean_period, sigma = _lay(time_s, tick, period, pauses, (width, unseen), True, room)
        error = _error(time_s, even)
    rms = _core.errors_deviation(error)
    even = _error(time_s, error)
    return EvenClock(kind, mean_period, sigma, tick, even, rms, is_seen, found.grid_s)


def _error(time_s: FloatArray, even: FloatArray) -> FloatArray:
    """``time_s - even``, written into ``even``; applied again it gives back the clock."""
    _core.timestamp_errors(time_s, even)
    return even


def _lay(
    time_s: FloatArray,
    tick: IntArray,
    period: float,
    pauses: IntArray,
    least_of: tuple[int, float],
    through_middle: bool,
    room: FloatArray,
) -> tuple[FloatArray, float, float]:
    """The even clock (n,) fitted to the earliest timestamps, or to the middle of all; its mean period over the longest
    section and the standard error of that. A rate that drifts is followed in ``PIECES``.

    ``least_of``: rows of a block, and deviation [s] below which the rate does not drift. The clock is written into
    ``room`` (n,)."""
    least, unseen = least_of
    late = lateness(time_s, tick, period, room)
    # Each section of the clock overwrites the lateness from which it is computed.
    even = late
    edges = np.concatenate([[0], pauses + 1, [len(late)]])
    sigma, longest, slope = np.inf, 0, 0.0
    for a, b in pairwise(edges):
        piece = late[a:b]
        # A clock drifts over minutes: more blocks than this only take memory.
        width = max(least, (b - a) // MOST_BLOCKS)
        if b - a < 4 * width:
            even[a:b] = piece.min() + period * tick[a:b]
            continue
        if through_middle:
            cut = (b - a) // width * width
            x = _core.block_mean_ticks(tick[a : a + cut], width)
            y = each = _core.block_medians(piece[:cut], width)
        else:
            at = _core.earliest_timestamps(piece, width)
            x, each = tick[a:b][at].astype(np.float64), piece[at]
            y = ahead(each, STALL_STEPS // width + 1)
        x0, scale = x.mean(), max(float(np.ptp(x)), 1.0)
        u = (x - x0) / scale
        line = _core.robust_line(u, y)
        left = y - np.polyval(line, u)
        noise = MAD_TO_SIGMA * median(np.abs(np.diff(each))) / np.sqrt(2.0) + 1e-3 * period
        size = min(max(len(y) // 12, 5), 401) | 1
        smooth = _core.running_median(left, size)
        # The rate drifts if the smoothed residual is far larger than the scatter of the blocks explains.
        curved = float(np.std(smooth)) > max(8.0 * noise / np.sqrt(size), unseen)
        course = None
        if curved and len(y) >= 24:
            course = _core.running_median(left, min(max(len(y) // PIECES, 5), 101) | 1)
        _core.lay_even_clock(tick[a:b], line, x0, scale, period, even[a:b])
        if course is not None:
            for p in _parts(a, b):
                even[p] += np.interp(tick[p], x, course)
        if b - a > longest:
            longest, slope = b - a, line[0] / scale
            spread = float(np.std(left - smooth if curved else left))
            # Delays of neighbouring blocks are correlated: four count as one.
            sigma = spread / scale / max(float(np.std(u)), 1e-9) / np.sqrt(max(len(y) / 4.0, 1.0))
    digits = float(np.spacing(max(abs(time_s[0]), abs(time_s[-1])))) / max(int(tick[-1] - tick[0]), 1)
    return even, period + slope, float(np.hypot(sigma, digits))


def _parts(first: int, stop: int) -> Iterator[slice]:
    """Yield slices of rows, in parts that need little memory."""
    for a in range(first, stop, 1 << 18):
        yield slice(a, min(a + (1 << 18), stop))


def _growth(error: FloatArray, pauses: IntArray, unseen: float) -> float:
    """Variance of the change of the timestamp error over 16 m rows divided by that over m rows, m <= 16."""
    edges = np.concatenate([[0], pauses + 1, [len(error)]])
    longest = int(np.argmax(np.diff(edges)))
    piece = error[edges[longest] : edges[longest + 1]][: 1 << 20]
    far = min(len(piece) // 8, 256)
    near = max(far // 16, 1)

    def typical(lag: int) -> float:
        change = np.abs(piece[lag:] - piece[:-lag])
        return float(np.mean(np.minimum(change, 8.0 * median(change) + TINY) ** 2))

    return typical(far) / max(typical(near), unseen**2)


def _kind(error: FloatArray, period: float, grid: float) -> TimestampKind:
    """Kind of timestamps from their errors (n,) [s] relative to the even clock."""
    probe = error[:: max(len(error) // 100_000, 1)]
    low, early, middle, late, high = quantiles(probe[:, None], [0.002, 0.01, 0.5, 0.99, 0.998])[:, 0]
    rms = float(np.std(probe))
    if rms < EXACT * period:
        return TimestampKind.EXACT
    # All but 2 % of the errors: rows next to a loss may be on its wrong side.
    if 0.0 < grid < 1.3 * period and late - early < 1.3 * grid:
        return TimestampKind.ROUNDED
    # One-sided errors have a sharp early edge and a late tail; or samples arrive in packets.
    together = _core.errors_falls(error, 0.7 * period) / max(len(error) - 1, 1)
    if high - middle > 2.0 * (middle - low) or together > 0.02 or high - low > 1.0 * period:
        return TimestampKind.LATE
    return TimestampKind.SCATTERED
