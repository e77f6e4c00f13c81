"""Lost samples put back: a cubic bridge across every gap, timestamps and poses behind it moved."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.records import Recording, Segments


def bridge(values: FloatArray, k: int, n: int) -> FloatArray:
    """(n, ...) samples between ``k`` and ``k + 1`` on a cubic Hermite through the two samples on either side."""
    if k < 1 or k + 2 >= len(values):
        return np.repeat(values[k : k + 1], n, axis=0)
    a, b = values[k], values[k + 1]
    da, db = values[k] - values[k - 1], values[k + 2] - values[k + 1]
    x = (np.arange(1, n + 1) / (n + 1)).reshape(-1, *([1] * (values.ndim - 1)))
    width = n + 1
    h00, h10 = 2 * x**3 - 3 * x**2 + 1, x**3 - 2 * x**2 + x
    h01, h11 = -2 * x**3 + 3 * x**2, x**3 - x**2
    out: FloatArray = h00 * a + h10 * width * da + h01 * b + h11 * width * db
    return out


def insert_samples(recording: Recording, segments: Segments, losses: dict[int, int]) -> tuple[Recording, Segments]:
    """Put ``n`` samples behind sample ``k`` for every ``k: n``, on a cubic through the two samples on either side.

    A cubic Hermite bridge keeps value and slope at both edges of the gap, so that the rotation integrated across it is
    right to the fifth power of its length. Time timestamps behind a gap move by what was lost.
    """
    n_old = recording.n_samples
    step = 1.0 / recording.rate_hz
    extra = np.zeros(n_old + 1, dtype=np.intp)
    for k, n in losses.items():
        extra[k + 1] += n
    shift = np.cumsum(extra)[:n_old]
    new_index = np.arange(n_old) + shift
    total = n_old + int(extra.sum())
    time_s = np.full(total, np.nan)
    time_s[new_index] = recording.time_s + shift * step
    gaps = np.isnan(time_s)
    time_s[gaps] = np.interp(np.flatnonzero(gaps), new_index, recording.time_s + shift * step)

    def bridged(values: FloatArray | None) -> FloatArray | None:
        if values is None:
            return None
        out = np.full((total, *values.shape[1:]), np.nan)
        out[new_index] = values
        for k, n in losses.items():
            out[k + shift[k] + 1 : k + shift[k] + 1 + n] = bridge(values, k, n)
        return out

    mended = replace(
        recording,
        time_s=time_s,
        accelerometer=bridged(recording.accelerometer),
        gyroscope=bridged(recording.gyroscope),
        temperature_degc=bridged(recording.temperature_degc),
        supply_v=bridged(recording.supply_v),
        auxiliary=type(recording.auxiliary)({}),
    ).knowing(recording.facts.moved(new_index))

    def at(index: int) -> int:
        return int(new_index[index]) if index < n_old else total

    holds = tuple(
        replace(
            hold,
            start=at(hold.start),
            stop=at(hold.stop - 1) + 1,
            outer_start=at(hold.outer_start),
            outer_stop=at(hold.outer_stop - 1) + 1,
            disturbed=tuple((at(a), at(b - 1) + 1) for a, b in hold.disturbed),
        )
        for hold in segments.poses
    )
    moves = tuple(
        replace(move, start=holds[move.pose_before].stop, stop=holds[move.pose_after].start) for move in segments.moves
    )
    mid = np.array([0.5 * (time_s[h.start] + time_s[h.stop - 1]) for h in holds])
    return mended, replace(segments, poses=holds, moves=moves, time_mid_s=mid, whole=None)
