"""Motion faster than the samples: the error of every move's integral by aliasing (eq. 8.2a).

A jolt on the table lasts a millisecond. Its power near the multiples of the sampling frequency f folds onto zero
frequency and is integrated as velocity or angle. It is extrapolated by a power law. With power c ν^-p on either side of
zero, the powers at f/4, at f/2 and folded onto zero are sums over all foldings,

    D₁ = c (f/4)^-p Z,   D₂ = 2 c (f/2)^-p Z,   A = 2 c f^-p Z / (1 - 2^-p),   Z = 1 + 3^-p + 5^-p + ...

so that D₁/D₂ = 2^p/2 and A = D₂/(2 D₁/D₂ - 1): all of D₂ where the samples are white (D₁ = D₂), no more, and a third of
it for a rate that steps (p = 2). D₁ contains slower motion too, which makes the slope look steep: up to the third, only
a part of D₁ is counted.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.quantiles import medians
from trihedron.session.rounding import UNIFORM

_AT_HALF, _AT_QUARTER = (
    (taps / np.abs(taps).sum()).tolist() for taps in (np.poly([1, 1, 1, 1]), np.poly([1, 1, -1, -1]))
)
"""Unit gain at half and at a quarter of the sampling frequency. Their zeros at zero frequency, of fourth and second
order, remove smooth motion."""
OF_A_STEP = 1.0 / 3.0
"""Power folded onto zero over that at half the sampling frequency for a rate with steps: 1/(2^p - 1) with p = 2."""
OF_ITS_BAND = 0.4
"""Part of the power around a quarter of the sampling frequency that is not slower motion, for a body that impacts and
rocks at a tenth of the sampling frequency."""
LENGTH = len(_AT_HALF)
GAP = 1.5
"""A step longer than this many usual ones has lost samples, as in the session model (its ``gaps``)."""
MARGIN = 3.0
"""Standard deviations of the noise's own power below which no motion is counted."""


def unresolved_variance(
    readings: FloatArray,
    move_ranges: Sequence[tuple[int, int]],
    pose_ranges: Iterable[Sequence[int]],
    step_s: float,
    quantum: FloatArray,
    time_s: FloatArray | None = None,
) -> FloatArray:
    """(moves, 3) variance, (raw unit · s)², of every move's integral by motion above half the sampling frequency.

    Raw ``readings`` (n, 3) of one sensor, half-open sample ranges. The poses give the power of the noise in both bands
    (their median), which is subtracted; at least that of rounding by the LSB ``quantum`` (3,), because a pose whose
    bias stays inside one LSB does not show its rounding, moves do. Filters run from gap to gap of the timestamps
    ``time_s`` (n,), across which smooth motion would look fast.
    """
    moves = np.array(move_ranges, dtype=np.int64).reshape(-1, 2)
    poses = np.array([(a, b) for a, b in pose_ranges if b - a >= LENGTH], dtype=np.int64).reshape(-1, 2)
    n_whole = np.maximum(moves[:, 1] - moves[:, 0] - (LENGTH - 1), 0)[:, None]
    n_poses = (poses[:, 1] - poses[:, 0] - (LENGTH - 1))[:, None]
    pieces, of_move = _between_gaps(moves, time_s, step_s)
    n_moves = np.bincount(of_move, pieces[:, 1] - pieces[:, 0] - (LENGTH - 1), len(moves))[:, None]

    def excess(taps: list[float]) -> FloatArray:
        power = _core.band_power(readings, taps, np.concatenate([poses, pieces]))
        level = medians(power[: len(poses)] / n_poses) if len(poses) else np.zeros(3)
        level = np.maximum(level, UNIFORM * quantum**2)
        # Neighbouring outputs of five taps share samples: about a third as many squares are independent.
        usual = level * (1.0 + MARGIN * np.sqrt(2.0 * 3.0 / np.maximum(n_moves, 1)))
        of_moves = np.stack([np.bincount(of_move, p, len(moves)) for p in power[len(poses) :].T], axis=1)
        # Samples across gaps are assumed to have the mean power of the move.
        out: FloatArray = np.maximum(of_moves - usual * n_moves, 0.0) * (n_whole / np.maximum(n_moves, 1))
        return out

    at_half, at_quarter = excess(_AT_HALF), excess(_AT_QUARTER)
    # The slope between the bands depends on filter and motion: that of the usual move is taken, not the largest.
    total, falls = at_quarter.sum(axis=1), at_half.sum(axis=1)
    both = (total > 0) & (falls > 0)
    fall = min(float(np.median(falls[both] / total[both])), 1.0) if np.any(both) else 1.0
    slowest = min(fall / OF_ITS_BAND, 1.0)
    part = max(fall / (2.0 - fall), min(slowest / (2.0 - slowest), OF_A_STEP))
    return at_half * part * step_s**2


def _between_gaps(ranges: IntArray, time_s: FloatArray | None, step_s: float) -> tuple[IntArray, IntArray]:
    """Half-open sample ranges (p, 2) without gaps, at least a filter long, and the index in ``ranges`` (m, 2) of each.

    A range in which long steps dominate stays whole, because its timestamps do not show gaps.
    """
    after = np.zeros(0, dtype=np.int64) if time_s is None else np.flatnonzero(np.diff(time_s) > GAP * step_s) + 1
    if not len(after):
        whole = np.flatnonzero(ranges[:, 1] - ranges[:, 0] >= LENGTH).astype(np.int64)
        return ranges[whole], whole
    pieces, owners = [], []
    for k, (start, stop) in enumerate(ranges):
        inside = after[(after > start) & (after < stop)]
        ends = np.concatenate([[start], inside, [stop]])
        own = np.stack([ends[:-1], ends[1:]], axis=1)
        windows = own[:, 1] - own[:, 0] - (LENGTH - 1)
        own = own[windows > 0] if 2 * windows[windows > 0].sum() > stop - start else np.array([[start, stop]])
        own = own[own[:, 1] - own[:, 0] >= LENGTH]
        pieces.append(own)
        owners.append(np.full(len(own), k, dtype=np.int64))
    if not pieces:
        return np.zeros((0, 2), dtype=np.int64), np.zeros(0, dtype=np.int64)
    return np.concatenate(pieces), np.concatenate(owners)
