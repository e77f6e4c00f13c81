"""Quiet blocks that turn: a slow steady turn is as quiet as a pose, and only the gyro's mean shows it."""

from __future__ import annotations

import numpy as np

from trihedron import probability
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.quantiles import medians
from trihedron.ranges import Range, ranges_of
from trihedron.segment.channels import WINDOW_BLOCKS, Channels, rolling_mean
from trihedron.segment.means import left_by_rounding
from trihedron.segment.runs import CREEP_PART, MIN_POSE_S, SAME_POSE, SWAY_RAD, speed_of_moves

TURN_SIGMAS = 6.0
"""A quiet gyro that reads further than this from the common zero, in robust standard deviations, is turning."""


def turning_blocks(
    channels: Channels, quiet: BoolArray, gravity: float | None, radians_per_reading: float | None
) -> BoolArray:
    """Quiet blocks in which the gyro reads far from its common zero: a slow steady turn, gravity says nothing of.

    The zero is where the windows of one second are densest, for turns may take most of the time; its scatter is theirs,
    or that of the poses' nearest windows where that is larger: a bias that depends on the pose is no turn. Where the
    accelerometer sees the tilt too, and the whole turn stays within ``SWAY_RAD`` by both sensors, the pose settles and
    remains a pose: a table that leans a little shows as small a tilt, but the gyro tells how far it turns.
    """
    out = np.zeros(len(quiet), dtype=bool)
    gyro = np.flatnonzero(channels.is_gyroscope)
    if not len(gyro) or not quiet.any():
        return out
    centre = medians(channels.mean[quiet][:, gyro])
    reading = np.where(channels.is_valid[:, None], channels.mean[:, gyro] - centre, 0.0)
    second = np.zeros_like(reading)
    ranges = ranges_of(quiet)
    for a, b in ranges:
        # Inside the quiet stretch only: the move next to it has its own say.
        second[a:b] = rolling_mean(reading[a:b], channels.blocks(1.0))
    bias, scatter = _densest(second[quiet])
    long = _edges([(a, b) for a, b in ranges if b - a >= channels.blocks(MIN_POSE_S)])
    if len(long) > 2:
        nearest = np.minimum.reduceat(np.abs(second[: long[-1]] - bias), long[:-1], axis=0)[::2]
        scatter = np.maximum(scatter, 1.4826 * medians(nearest))
    # A few short poses hold a few independent seconds: the shortest interval among them flatters. No window is known
    # better than the white noise of its blocks.
    inner = _edges([(a, b - 1) for a, b in ranges if b - a >= 2])
    if len(inner):
        squares = np.add.reduceat(np.diff(reading[: inner[-1] + 1], axis=0) ** 2, inner[:-1], axis=0)[::2]
        variance = squares / (2.0 * np.diff(inner)[::2, None])
        scatter = np.maximum(scatter, np.sqrt(medians(variance) / channels.blocks(1.0)))
    step2 = np.where(channels.quantum[gyro] > 0.0, channels.quantum[gyro] ** 2, np.finfo(np.float64).tiny)
    noise = medians(channels.variance[quiet][:, gyro]) - channels.quantisation_variance[gyro]
    scatter = np.maximum(scatter, np.sqrt(left_by_rounding(noise, step2)[0] * step2))
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.nan_to_num(np.abs(second - bias) / scatter, nan=0.0)
    top = speed_of_moves(channels, quiet)
    out[:] = quiet & (distance > TURN_SIGMAS).any(axis=1)
    for a, b in ranges:
        flagged = a + np.flatnonzero(out[a:b])
        if not len(flagged):
            continue
        is_slow = bool((np.abs(second[flagged] - bias).max(axis=0) < CREEP_PART * top).all())
        if radians_per_reading is not None:
            # Within a factor of two, which is what is known of the scale.
            turned = (reading[flagged] - bias).sum(axis=0) * channels.step_s * radians_per_reading
            is_slow = is_slow and float(np.linalg.norm(turned)) < 2.0 * SWAY_RAD
        if gravity is not None and is_slow and _tilts_a_little(channels, flagged[0], flagged[-1] + 1, gravity):
            out[a:b] = False
        for first, last in ranges_of(out[a:b]):
            # A turn of any length fills a whole second of windows; at the ends of the stretch it may run on outside.
            if last - first < WINDOW_BLOCKS and first > 0 and last < b - a:
                out[a + first : a + last] = False
    return out


def _edges(ranges: list[Range]) -> IntArray:
    """Edges of ranges one after the other, as ``reduceat`` wants them: every other stretch lies between two ranges."""
    return np.array(ranges, dtype=np.int64).ravel()


def _tilts_a_little(channels: Channels, first: int, last: int, gravity: float) -> bool:
    """The accelerometer too sees a drift over the stretch, of no more than a hand's sway."""
    attitude = channels.mean[first:last, ~channels.is_gyroscope]
    half = len(attitude) // 2
    if half < 1 or not attitude.shape[1]:
        return False
    drift = attitude[-half:].mean(axis=0) - attitude[:half].mean(axis=0)
    steps = np.diff(attitude, axis=0)
    variance = (steps**2).mean(axis=0) / half
    live = variance > 0.0
    statistic = float((drift[live] ** 2 / variance[live]).sum())
    # The halves' means are half of the whole drift apart.
    is_small = 2.0 * float(np.linalg.norm(drift)) / gravity < SWAY_RAD
    return is_small and statistic > float(probability.chdtri(max(int(live.sum()), 1), SAME_POSE))


def _densest(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Middle of the shortest interval that holds a quarter of the values of each axis, and the deviation it implies."""
    ordered = np.sort(values, axis=0)
    n = len(ordered)
    quarter = max(n // 4, 1)
    width = ordered[quarter:] - ordered[: n - quarter] if n > quarter else np.zeros((1, values.shape[1]))
    at = width.argmin(axis=0)
    axes = np.arange(values.shape[1])
    middle: FloatArray = ordered[at + quarter // 2, axes]
    deviation: FloatArray = width[at, axes] / (2.0 * float(probability.ndtri(0.5 + 0.25 / 2.0)))
    return middle, deviation
